#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Precision and recall of `holba match`'s segment matches, against the 3D lines that `holba refine --Refine.fix_poses 1`
finds on true poses in the same segments (Python's standard library only).

For each set FOLDER/SET holds d.db (a database after `extract` and `match`) and ref/ (the refined model, --output_type txt,
made with a copy of d.db). Judged are segments of lines that are seen in --min_images images or more: a match (mutual
nearest ones with a ratio of --ratio to the second nearest, as the program uses them) is right if both segments are of one
line. Precision: the right ones among the matches whose both segments are of such lines. Recall: segments that have a
right match among those of lines that both images see. By distance in the order of the names: next images, 4 further on, all.
Example: benchmark/line_matches.py FOLDER entry_p10,herzjesu_p8
"""

import argparse
import collections
import pathlib
import sqlite3
import struct


def mutual_nearest(matches, max_ratio):
    """As MutualNearest of line_matching.h. matches: (idx1, idx2, distance)."""
    two = [collections.defaultdict(lambda: [float("inf")] * 2) for _ in range(2)]
    for match in matches:
        for side in range(2):
            entry = two[side][match[side]]
            entry[:] = sorted([*entry, match[2]])[:2]
    for idx1, idx2, distance in matches:
        (first1, second1), (first2, second2) = two[0][idx1], two[1][idx2]
        if distance > first1 or distance > first2:
            continue
        if distance < max_ratio * second1 and distance < max_ratio * second2:
            yield idx1, idx2


def records(path):
    return [line.split() for line in open(path) if line.strip() and not line.startswith("#")]


def read_lines(model, min_images):
    """{image_id: {segment: line}} of lines with that many images, {image_id: segments}."""
    segments, line_of = {}, {}
    images = collections.defaultdict(set)
    for fields in records(model / "lines2D.txt"):
        rows = [fields[2 + 5 * i:7 + 5 * i] for i in range(int(fields[1]))]
        segments[int(fields[0])] = rows
        line_of[int(fields[0])] = {i: row[4] for i, row in enumerate(rows) if row[4] != "-1"}
        for line in line_of[int(fields[0])].values():
            images[line].add(int(fields[0]))
    kept = {image: {i: line for i, line in lines.items() if len(images[line]) >= min_images}
            for image, lines in line_of.items()}
    return kept, segments


def evaluate(folder, args):
    database = sqlite3.connect(folder / args.database)
    kept, segments = read_lines(folder / "ref", args.min_images)
    for image, blob in database.execute("SELECT image_id, data FROM holba_segments"):
        stored = list(struct.iter_unpack("<4d", blob))
        if image in segments and [[float(x) for x in row[:4]] for row in segments[image]] != [list(s) for s in stored]:
            raise SystemExit(f"{folder}: the segments of image {image} are others than the model's")
    order = [row[0] for row in database.execute("SELECT image_id FROM images ORDER BY name")]
    position = {image: i for i, image in enumerate(order)}
    sums = {gap: [0, 0, 0, 0] for gap in (1, 4, "all")}
    query = "SELECT image_id1, image_id2, data, distances FROM holba_line_matches"
    for image1, image2, data, distances in database.execute(query):
        if image1 not in kept or image2 not in kept:
            continue
        of1, of2 = kept[image1], kept[image2]
        matches = [(a, b, d) for (a, b), (d,) in zip(struct.iter_unpack("<2I", data), struct.iter_unpack("<f", distances))]
        judged = [(a, b) for a, b in mutual_nearest(matches, args.ratio) if a in of1 and b in of2]
        right = {a for a, b in judged if of1[a] == of2[b]}
        both = set(of1.values()) & set(of2.values())
        wanted = {i for i, line in of1.items() if line in both}
        candidates = {a for a, b, _ in matches if a in wanted and of1[a] == of2.get(b)}
        for gap in (abs(position[image1] - position[image2]), "all"):
            if gap in sums:
                for k, value in enumerate((len(judged), len(right), len(wanted), len(candidates))):
                    sums[gap][k] += value
    return sums


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("sets")
    parser.add_argument("--database", default="d.db")
    parser.add_argument("--min_images", type=int, default=4)
    parser.add_argument("--ratio", type=float, default=0.9)
    args = parser.parse_args()
    print("| set | next images | 4 further on | all verified pairs | right among the candidates |\n| --- | --- | --- | --- | ---: |")
    for name in args.sets.split(","):
        sums = evaluate(args.folder / name, args)
        cells = [f"{r / max(j, 1):.3f}, {r / max(w, 1):.3f} ({j})" for j, r, w, _ in sums.values()]
        print(f"| {name} | " + " | ".join(cells) + f" | {sums['all'][3] / max(sums['all'][2], 1):.3f} |", flush=True)


if __name__ == "__main__":
    main()
