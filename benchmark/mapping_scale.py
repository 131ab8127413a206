#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Mapping at size: `holba map` with points alone and with structure beside COLMAP's mapper and COLMAP 4's incremental
mapper, on databases that `holba synthesize` makes. Prints two Markdown tables: registered images, seconds of processor
time in user mode and pose AUC (percent) for each scene, size and program; and how the time grows with the number of
images (exponent of a power law, least squares over all sizes). Standard library only.

Example: benchmark/mapping_scale.py --output RUNS --images 100,200,500,1000 --colmap colmap --pycolmap venv/bin/python
"""

import argparse
import pathlib
import subprocess

from mappers import HEADER, Bench, add_arguments, colmap_mapper, growth_exponent, holba_mapper, pycolmap_mapper
from real_sets import markdown


def make_database(arguments, scene: str, num_images: int) -> tuple[pathlib.Path, pathlib.Path]:
    """The database and the folder of its truth, made unless they are there."""
    words = [*arguments.synthesize.split(), "--Database.focal_length", arguments.focal_length]
    name = "-".join([scene, str(num_images), str(arguments.seed), *(w.removeprefix("--Database.") for w in words)])
    folder = arguments.output / "databases"
    database, truth = folder / f"{name}.db", folder / f"{name}-truth"
    if not database.exists():
        subprocess.run([arguments.holba, "synthesize", "--quiet", "--database_path", str(database), "--output_path",
                        str(truth), "--num_images", str(num_images), "--seed", str(arguments.seed), "--Database.scene",
                        scene, *words], check=True)
    return database, truth


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", default="sphere,street,collection")
    parser.add_argument("--images", default="100,200,500,1000", help="sizes")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--focal_length", default="exact", choices=["exact", "exif", "unknown"],
                        help="what the databases know of cameras; exact ones are held")
    parser.add_argument("--synthesize", default="", help="further options of `holba synthesize`, as one word")
    add_arguments(parser)
    arguments = parser.parse_args()

    bench = Bench(arguments.holba, arguments.output, arguments.output / "peers", arguments.limit_seconds)
    programs = [(f"holba {s}", holba_mapper(arguments.holba, s, arguments.options), False)
                for s in arguments.structures.split(",") if s]
    if arguments.colmap:
        programs.append(("COLMAP mapper", colmap_mapper(arguments.colmap), True))
    if arguments.pycolmap:
        programs.append(("COLMAP 4 incremental", pycolmap_mapper(arguments.pycolmap, "incremental"), True))

    sizes = [int(word) for word in arguments.images.split(",")]
    known = arguments.focal_length == "exact"
    rows, growth_rows = [], []
    for scene in arguments.scenes.split(","):
        seconds = {title: ([], []) for title, _, _ in programs}
        for num_images in sizes:
            database, truth = make_database(arguments, scene, num_images)
            for title, mapper, is_peer in programs:
                score = bench.score(title, mapper, database, truth, None, known, is_peer)
                rows.append([scene, str(num_images), title, *score.cells()])
                if not score.failure:
                    seconds[title][0].append(num_images)
                    seconds[title][1].append(score.seconds)
        for title, (done, values) in seconds.items():
            exponent = growth_exponent(done, values)
            growth_rows.append([scene, title, ", ".join(map(str, done)), f"{exponent:.2f}" if exponent else "-"])
    print(markdown(["scene", "images", "program", *HEADER], rows, 3))
    print()
    print(markdown(["scene", "program", "sizes", "growth of time"], growth_rows, 3))


if __name__ == "__main__":
    main()
