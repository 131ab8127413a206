#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Mapping of real photographs: `holba map` with points alone and with structure beside COLMAP's mappers, from databases
that COLMAP's extraction and matching filled and from holba's own, with known (held) and with unknown intrinsics. Prints
a Markdown table of registered images, seconds of processor time in user mode and pose AUC (percent) against the truth,
and one of means over the sets. Standard library only.

Peers are given as a skilled user runs them: COLMAP's mapper, COLMAP 4's incremental and global ones, each as it is and
("refined") adjusted once more with Cauchy loss, points of three or more images and, with unknown intrinsics, a free
principal point. Databases and peers' results are kept in --output.

DATA/SET/images are the photographs, DATA/SET/gt a model with the true poses. Known intrinsics are those of gt, where all
its images have one camera.
Example: benchmark/mapping_sets.py --data DATA --output RUNS --colmap colmap --pycolmap venv/bin/python
"""

import argparse
import math
import pathlib
import subprocess
import sys

from mappers import HEADER, Bench, add_arguments, colmap_mapper, holba_mapper, pycolmap_mapper
from real_sets import THRESHOLDS_DEG, markdown
from refine_sets import read_records


def camera_words(truth: pathlib.Path, known: bool) -> list[str] | None:
    """Options of feature extraction. None: the cameras cannot be given."""
    cameras = read_records(truth / "cameras.txt")
    single = ["--ImageReader.single_camera", "1"] if len(cameras) == 1 else []
    if not known:
        return ["--ImageReader.camera_model", "SIMPLE_RADIAL", *single]
    if not single:
        return None
    return ["--ImageReader.camera_model", cameras[0][1], "--ImageReader.camera_params", ",".join(cameras[0][4:]),
            *single]


def make_database(arguments, name: str, known: bool, source: str) -> pathlib.Path | None:
    """With features and matches of `source`, made unless it is there."""
    words = camera_words(arguments.data / name / "gt", known)
    if words is None:
        return None
    database = arguments.output / "databases" / f"{name}-{'known' if known else 'unknown'}-{source}.db"
    if database.exists():
        return database
    database.parent.mkdir(parents=True, exist_ok=True)
    print(f"{database.stem}: features and matches", file=sys.stderr, flush=True)
    begun = database.with_suffix(".begun")
    for path in begun.parent.glob(begun.name + "*"):
        path.unlink()
    images = arguments.data / name / "images"
    if source == "colmap":
        steps = [[arguments.colmap, "feature_extractor", "--image_path", images, *words, "--SiftExtraction.use_gpu", "0"],
                 [arguments.colmap, "exhaustive_matcher", "--SiftMatching.use_gpu", "0"]]
    else:
        steps = [[arguments.holba, "extract", "--image_path", images, *words], [arguments.holba, "match"]]
    for step in steps:
        subprocess.run([*map(str, step), "--database_path", str(begun)], check=True, capture_output=True)
    begun.rename(database)
    return database


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=pathlib.Path, required=True, help="folder of the image sets")
    parser.add_argument("--sets", help="names, separated by commas (default: all with images and gt)")
    parser.add_argument("--intrinsics", default="known,unknown")
    parser.add_argument("--matches", default="colmap,holba", help="whose features and matches (colmap needs --colmap)")
    add_arguments(parser)
    arguments = parser.parse_args()

    names = arguments.sets.split(",") if arguments.sets else sorted(
        p.parent.name for p in arguments.data.glob("*/images") if (p.parent / "gt" / "images.txt").is_file())
    if not names:
        parser.error(f"no set with folders images and gt in {arguments.data}")
    sources = [s for s in arguments.matches.split(",") if s != "colmap" or arguments.colmap]

    bench = Bench(arguments.holba, arguments.output, arguments.output / "peers", arguments.limit_seconds)
    programs = [(f"holba {s}", holba_mapper(arguments.holba, s, arguments.options), False)
                for s in arguments.structures.split(",") if s]
    if arguments.colmap:
        programs.append(("COLMAP mapper", colmap_mapper(arguments.colmap), True))
    if arguments.colmap and arguments.pycolmap:
        programs.append(("COLMAP mapper, refined", colmap_mapper(arguments.colmap, arguments.pycolmap), True))
    if arguments.pycolmap:
        for kind in ("incremental", "global"):
            for refined in (False, True):
                programs.append((f"COLMAP 4 {kind}{', refined' if refined else ''}",
                                 pycolmap_mapper(arguments.pycolmap, kind, refined), True))

    rows, sums = [], {}
    for name in names:
        truth = arguments.data / name / "gt"
        for intrinsics in arguments.intrinsics.split(","):
            known = intrinsics == "known"
            for source in sources:
                database = make_database(arguments, name, known, source)
                if database is None:
                    continue
                for title, mapper, is_peer in programs:
                    score = bench.score(title, mapper, database, truth, arguments.data / name / "images", known, is_peer)
                    rows.append([name, intrinsics, source, title, *score.cells()])
                    sums.setdefault((intrinsics, source, title), []).append(score)
    print(markdown(["set", "intrinsics", "matches", "program", *HEADER], rows, 4))
    print("\nMeans over the sets; a set that gave no model counts nothing registered and 0 %:\n")
    mean_rows = []
    for (intrinsics, source, title), scores in sums.items():
        count = len(scores)
        seconds = sum(s.seconds for s in scores if not math.isnan(s.seconds))
        mean_rows.append([intrinsics, source, title, str(count), str(sum(s.registered for s in scores)),
                          f"{seconds:.1f}",
                          *(f"{sum(s.auc.get(t, 0.0) for s in scores) / count:.1f}" for t in THRESHOLDS_DEG)])
    print(markdown(["intrinsics", "matches", "program", "sets", "registered", "user s, all",
                    *(f"@{t}" for t in THRESHOLDS_DEG)], mean_rows, 3))


if __name__ == "__main__":
    main()
