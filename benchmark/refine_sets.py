#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Runs `holba refine` on real image sets and prints Markdown tables: pose AUC against the truth from COLMAP models with
known and with unknown intrinsics (COLMAP's input, points alone with the same robust loss, refine), what was found, the
angles between the dominant directions without relations imposed, and the time beside that of COLMAP's mapper. Standard
library only.

DATA/SET/images are the photographs, DATA/SET/colmap/pinhole_fixed and simple_radial COLMAP's models with the true
intrinsics and with the camera unknown, DATA/SET/gt a model with the true poses.
Example: benchmark/refine_sets.py --data DATA --sets entry_p10,fountain_p11 --output RUNS
"""

import argparse
import itertools
import json
import math
import pathlib
import subprocess
import sys
import tempfile
import time

from real_sets import KNOWN_INTRINSICS, auc_cells, markdown, run

# Unknown intrinsics: all of them are adjusted, the principal point, too (refine's default; adjust's is COLMAP's).
KNOWN = [*KNOWN_INTRINSICS, "--Bundle.refine_principal_point", "0"]
INPUTS = {"known": ("pinhole_fixed", KNOWN), "unknown": ("simple_radial", ["--Bundle.refine_principal_point", "1"])}


def read_records(path: pathlib.Path) -> list[list[str]]:
    return [line.split() for line in path.read_text().splitlines() if line and not line.startswith("#")]


def directions(model: pathlib.Path, kind: str) -> list[tuple[list[float], int]]:
    """Direction (or normal) and number of members of every group of a kind, most members first."""
    groups = []
    for fields in read_records(model / "groups3D.txt"):
        if fields[1] != kind:
            continue
        num_params = int(fields[2])
        num_points = int(fields[3 + num_params])
        num_lines = int(fields[4 + num_params + num_points])
        groups.append(([float(x) for x in fields[3:6]], num_points + num_lines))
    return sorted(groups, key=lambda group: -group[1])


def angle_deg(a: list[float], b: list[float]) -> float:
    """Between two unit vectors up to their signs."""
    return math.degrees(math.acos(min(1.0, abs(sum(x * y for x, y in zip(a, b))))))


def manhattan_cells(model: pathlib.Path) -> list[str]:
    """Angles between the three directions with most lines that are mutually nearly orthogonal (within 10 degrees), and
    how far the normals of the planes are from them: planes within 10 degrees of one, weighted by their points."""
    vps = directions(model, "VP")
    planes = directions(model, "PLANE")
    triples = [t for size in (3, 2) for t in itertools.combinations(vps, size)
               if all(angle_deg(a[0], b[0]) > 80 for a, b in itertools.combinations(t, 2))]
    if not triples:
        return [str(len(vps)), "-", "-"]
    best = max(triples, key=lambda t: sum(v[1] for v in t))
    # Where only two are seen, the third is perpendicular to both.
    axes = [v[0] for v in best]
    if len(axes) == 2:
        (a, b, c), (d, e, f) = axes
        cross = [b * f - c * e, c * d - a * f, a * e - b * d]
        norm = math.sqrt(sum(x * x for x in cross))
        axes.append([x / norm for x in cross])
    angles = " ".join(f"{angle_deg(a[0], b[0]):.2f}" for a, b in itertools.combinations(best, 2))
    near = []
    for normal, members in planes:
        off = min(angle_deg(normal, axis) for axis in axes)
        if off < 10:
            near.append((off, members))
    total = sum(m for _, m in near)
    mean = f"{sum(o * m for o, m in near) / total:.2f} ({len(near)} of {len(planes)})" if near else "-"
    return [str(len(vps)), angles, mean]


def mapper_seconds(colmap: str, data: pathlib.Path, name: str, folder: pathlib.Path) -> float:
    """Wall time of COLMAP's mapper with the true intrinsics; features and matches are made first, if not there."""
    camera = read_records(data / name / "gt" / "cameras.txt")[0]
    database = folder / f"{name}.db"
    images = data / name / "images"
    if not database.exists():
        subprocess.run([colmap, "feature_extractor", "--database_path", database, "--image_path", images,
                        "--ImageReader.camera_model", camera[1], "--ImageReader.single_camera", "1",
                        "--ImageReader.camera_params", ",".join(camera[4:]), "--SiftExtraction.use_gpu", "0"],
                       check=True, capture_output=True)
        subprocess.run([colmap, "exhaustive_matcher", "--database_path", database, "--SiftMatching.use_gpu", "0"],
                       check=True, capture_output=True)
    sparse = folder / f"{name}_sparse"
    sparse.mkdir(exist_ok=True)
    start = time.monotonic()
    subprocess.run([colmap, "mapper", "--database_path", database, "--image_path", images, "--output_path", sparse,
                    "--Mapper.ba_refine_focal_length", "0", "--Mapper.ba_refine_extra_params", "0"],
                   check=True, capture_output=True)
    return time.monotonic() - start


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=pathlib.Path, required=True, help="folder of the image sets")
    parser.add_argument("--sets", help="names, separated by commas (default: all with images, colmap and gt)")
    parser.add_argument("--inputs", default="known,unknown", help="known, unknown or both (default)")
    parser.add_argument("--holba", default=str(pathlib.Path(__file__).parent.parent / "build" / "bin" / "holba"),
                        help="the program (default: build/bin/holba)")
    parser.add_argument("--colmap", help="the program colmap, to time its mapper (default: not timed)")
    parser.add_argument("--output", type=pathlib.Path, help="keep models and pictures here")
    parser.add_argument("options", nargs="*", help="further options of `holba refine`, after --")
    arguments = parser.parse_args()

    data = arguments.data
    names = arguments.sets.split(",") if arguments.sets else sorted(
        p.parent.name for p in data.glob("*/colmap") if (p.parent / "gt" / "images.txt").is_file())
    if not names:
        parser.error(f"no set with folders images, colmap and gt in {data}")

    with tempfile.TemporaryDirectory() as temporary:
        folder = arguments.output or pathlib.Path(temporary)
        folder.mkdir(parents=True, exist_ok=True)
        auc_rows, found_rows, direction_rows, time_rows = [], [], [], []
        for name in names:
            truth = data / name / "gt"
            for kind in arguments.inputs.split(","):
                model, intrinsics = INPUTS[kind]
                start = data / name / "colmap" / model
                point = folder / f"{name}_{kind}_point"
                refined = folder / f"{name}_{kind}"
                (folder / f"{name}_{kind}.db").unlink(missing_ok=True)
                print(f"{name}, {kind} intrinsics", file=sys.stderr)
                run(arguments.holba, "adjust", "--input_path", start, "--output_path", point,
                    "--Bundle.config", "point", *intrinsics)
                begin = time.monotonic()
                report = run(arguments.holba, "refine", "--image_path", data / name / "images", "--input_path", start,
                             "--output_path", refined, "--database_path", folder / f"{name}_{kind}.db",
                             "--output_type", "txt", *intrinsics, *arguments.options)
                seconds = time.monotonic() - begin
                for title, result in [("COLMAP (input)", start), ("Point", point), ("refine", refined)]:
                    auc_rows.append([name, kind, title, " / ".join(auc_cells(arguments.holba, result, truth))])
                if kind == "known":
                    lines = report["lines"]
                    found_rows.append([name, str(lines["in_4_or_more_images"]), str(lines["reliable_1_percent"]),
                                       f"{lines['leave_one_out_median_px']:.2f}", str(report["groups"].get("VP", 0)),
                                       str(report["groups"].get("PLANE", 0)), str(report["points_on_planes"]),
                                       str(report["junctions"]), str(report["corners"]), str(report["edges"]),
                                       str(report["relations"])])
                    free = folder / f"{name}_{kind}_free"
                    run(arguments.holba, "refine", "--image_path", data / name / "images", "--input_path", start,
                        "--output_path", free, "--database_path", folder / f"{name}_{kind}.db", "--output_type", "txt",
                        "--Relations.form", "0", *intrinsics, *arguments.options)
                    direction_rows.append([name, *manhattan_cells(free)])
                    mapper = mapper_seconds(arguments.colmap, data, name, folder) if arguments.colmap else None
                    time_rows.append([name, f"{seconds:.2f}"] + [f"{report['seconds'][k]:.1f}" for k in
                                     ("detect", "match", "structure", "adjust")]
                                     + [f"{mapper:.2f}" if mapper else "-"])
        print(markdown(["set", "intrinsics", "", "AUC @0.5 / 1 / 3 / 5 deg, %"], auc_rows, 3))
        if found_rows:
            print()
            print(markdown(["set", "lines in 4 images", "ends known to 1 %", "left out, px", "VPs", "planes",
                            "points on planes", "junctions", "corners", "edges", "relations"], found_rows, 1))
            print()
            print(markdown(["set", "VPs", "angles of three, deg", "plane normals off them, deg"], direction_rows, 1))
            print()
            print(markdown(["set", "refine, s", "detect", "match", "structure", "adjust", "COLMAP mapper, s"],
                           time_rows, 1))


if __name__ == "__main__":
    main()
