#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Pairs that `holba match --pairs retrieval` lists, against the models of the sets they are from.

  retrieval.py --holba HOLBA --database DATABASE --models FOLDER [--num_images 30]

DATABASE has the features of photographs SET/NAME of many sets; FOLDER/SET/colmap/pinhole_fixed or
simple_radial is a COLMAP model of a set (read with pycolmap). Two images of a set are a true pair
if 15 or more points of its model are seen by both. Two measures:
  listed  share of the true pairs that are listed;
  held    of each image's true partners the share that it is listed with, both counted up to
          num_images: what a list of that length can hold.
Sets whose names begin alike up to the first digit or underscore are taken for pictures of one
place (herzjesu_p8 and herzjesu_p25). What the images of one have of another's is not judged by the
models; the measures are also given without the place's other sets ("alone").
"""
import argparse
import collections
import itertools
import os
import re
import shutil
import sqlite3
import subprocess
import tempfile

import pycolmap


def true_pairs(models, names):
    ids = {name: i for i, name in names.items()}
    pairs = {}
    for name in sorted({n.split("/")[0] for n in ids}):
        paths = [f"{models}/{name}/colmap/{k}" for k in ("pinhole_fixed", "simple_radial")]
        path = next((p for p in paths if os.path.exists(f"{p}/points3D.bin")), None)
        if path is None:
            continue
        model = pycolmap.Reconstruction(path)
        common = collections.Counter()
        for point in model.points3D.values():
            seen = {ids.get(f"{name}/{model.images[e.image_id].name}") for e in point.track.elements}
            common.update(itertools.combinations(sorted(seen - {None}), 2))
        pairs[name] = {pair for pair, count in common.items() if count >= 15}
    return pairs


def listed_pairs(args, leave_out):
    with tempfile.TemporaryDirectory() as folder:
        path = f"{folder}/copy.db"
        shutil.copy(args.database, path)
        connection = sqlite3.connect(path)
        for (image_id, name) in connection.execute("SELECT image_id, name FROM images").fetchall():
            if name.split("/")[0] in leave_out:
                # Without descriptors they are listed with nothing.
                connection.execute("DELETE FROM descriptors WHERE image_id = ?", (image_id,))
        connection.execute("DELETE FROM matches")
        connection.execute("DELETE FROM two_view_geometries")
        connection.commit()
        connection.close()
        # Only which pairs there are is of interest: one feature each is matched.
        command = [args.holba, "match", "--quiet", "--database_path", path, "--pairs", "retrieval"]
        command += ["--Retrieval.num_images", str(args.num_images)]
        command += ["--FeatureMatching.max_num_matches", "1"]
        command += ["--FeatureMatching.skip_geometric_verification", "1"]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        connection = sqlite3.connect(path)
        rows = connection.execute("SELECT pair_id FROM matches").fetchall()
        connection.close()
        return {(row[0] // 2147483647, row[0] % 2147483647) for row in rows}


def measure(true, listed, num_images):
    """True pairs, those listed, partners that can be held, those held."""
    of_image, found = collections.Counter(), collections.Counter()
    for pair in true:
        of_image.update(pair)
        if pair in listed:
            found.update(pair)
    held = sum(min(num_images, n) for n in found.values())
    can_be_held = sum(min(num_images, n) for n in of_image.values())
    return [len(true), len(true & listed), can_be_held, held]


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--holba", default="holba")
    parser.add_argument("--database", required=True)
    parser.add_argument("--models", required=True)
    parser.add_argument("--num_images", type=int, default=30)
    args = parser.parse_args()
    connection = sqlite3.connect(args.database)
    true = true_pairs(args.models, dict(connection.execute("SELECT image_id, name FROM images")))
    connection.close()
    place = lambda name: re.split(r"[_0-9]", name)[0]
    runs = {}

    def run(leave_out):
        if leave_out not in runs:
            runs[leave_out] = listed_pairs(args, leave_out)
        return runs[leave_out]

    # As few runs as do: the k-th set of every place together.
    of_place = collections.defaultdict(list)
    for name in true:
        of_place[place(name)].append(name)
    all_sums = [[0] * 4, [0] * 4]
    print("| set | true pairs | listed | held | alone: listed | held |")
    print("| --- | ---: | ---: | ---: | ---: | ---: |")
    for name in sorted(true):
        k = of_place[place(name)].index(name)
        leave_out = frozenset(
            other for sets in of_place.values() for i, other in enumerate(sets) if i != k % len(sets)
        )
        both = [measure(true[name], run(lo), args.num_images) for lo in (frozenset(), leave_out)]
        for sums, values in zip(all_sums, both):
            for i, value in enumerate(values):
                sums[i] += value
        print_row(name, both)
    print_row("all", all_sums)


def print_row(name, both):
    cells = [f"{100 * b / max(a, 1):.1f} %" for v in both for a, b in (v[:2], v[2:])]
    print(f"| {name} | {both[0][0]} | " + " | ".join(cells) + " |", flush=True)


if __name__ == "__main__":
    main()
