#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Adjusts real COLMAP models with holba and with COLMAP's own bundle_adjuster from the same perturbed start, and
compares the costs that `holba evaluate` finds. COLMAP's programs must open what holba wrote.

    real_models.py --holba P --data DIR SET...    DIR/SET/colmap/{pinhole_fixed,simple_radial}
    real_models.py --holba P --data DIR --all     every set of DIR, with a table

Exit status 77: the data, or COLMAP, is not there."""

import argparse
import json
import os
import pathlib
import re
import subprocess
import sys
import tempfile
import time
import zlib

import numpy as np

ROTATION_DEG = 0.2       # standard deviation of the start's rotations, per axis
SHARE_OF_SPREAD = 0.01   # and of camera centres and points, per coordinate, of the spread of the camera centres
WORST_RATIO = 1 + 1e-4
VARIANTS = {"pinhole_fixed": 0, "simple_radial": 1}  # whether intrinsics are adjusted
SKIPPED = 77


def run(words: list, **kwargs) -> str:
    environment = {**os.environ, "QT_QPA_PLATFORM": "offscreen"}
    result = subprocess.run([str(word) for word in words], capture_output=True, text=True, env=environment, **kwargs)
    if result.returncode != 0:
        raise SystemExit(f"{' '.join(map(str, words))} failed:\n{result.stdout[-2000:]}{result.stderr[-2000:]}")
    return result.stdout + result.stderr


def multiply(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Quaternions w x y z."""
    return np.array([a[0] * b[0] - a[1:] @ b[1:], *(a[0] * b[1:] + b[0] * a[1:] + np.cross(a[1:], b[1:]))])


def rotate(q: np.ndarray, v: np.ndarray) -> np.ndarray:
    return v + 2 * np.cross(q[1:], np.cross(q[1:], v) + q[0] * v)


def perturb(source: pathlib.Path, target: pathlib.Path, seed: int) -> int:
    """A text model with poses and points moved at random. Returns the number of observations."""
    random = np.random.default_rng(seed)
    target.mkdir()
    (target / "cameras.txt").write_text((source / "cameras.txt").read_text())
    lines = [line for line in (source / "images.txt").read_text().split("\n") if not line.startswith("#")]
    poses = {}
    for at in range(0, len(lines) - 1, 2):
        words = lines[at].split(None, 9)
        q, t = np.array(words[1:5], float), np.array(words[5:8], float)
        q /= np.linalg.norm(q)
        poses[at] = (words, q, -rotate(q * [1, -1, -1, -1], t))
    centres = np.array([centre for _, _, centre in poses.values()])
    spread = np.sqrt(np.mean(np.sum((centres - centres.mean(axis=0)) ** 2, axis=1)))
    for at, (words, q, centre) in poses.items():
        turn = np.append(1.0, 0.5 * np.radians(random.normal(0, ROTATION_DEG, 3)))
        q = multiply(turn / np.linalg.norm(turn), q)
        t = -rotate(q, centre + random.normal(0, SHARE_OF_SPREAD * spread, 3))
        words[1:8] = [repr(float(x)) for x in (*q, *t)]
        lines[at] = " ".join(words)
    (target / "images.txt").write_text("\n".join(lines))
    points, observations = [], 0
    for line in (source / "points3D.txt").read_text().split("\n"):
        if not line or line.startswith("#"):
            continue
        words = line.split()
        xyz = np.array(words[1:4], float) + random.normal(0, SHARE_OF_SPREAD * spread, 3)
        words[1:4] = [repr(float(x)) for x in xyz]
        observations += (len(words) - 8) // 2
        points.append(" ".join(words))
    (target / "points3D.txt").write_text("\n".join(points) + "\n")
    return observations


def point_cost(holba: str, model: pathlib.Path) -> dict:
    return json.loads(run([holba, "evaluate", "--input_path", model, "--json"]).split("\n\n")[0])["terms"]["point"]


def check_that_colmap_opens(colmap: str, model: pathlib.Path, folder: pathlib.Path, observations: int):
    text = run([colmap, "model_analyzer", "--path", model])
    found = int(re.search(r"Observations: (\d+)", text).group(1))
    assert found == observations, f"model_analyzer counts {found} observations of {observations}"
    folder.mkdir()
    run([colmap, "model_converter", "--input_path", model, "--output_path", folder, "--output_type", "TXT"])
    assert (folder / "points3D.txt").stat().st_size > 0


def compare(holba: str, colmap: str, source: pathlib.Path, refine: int, folder: pathlib.Path) -> dict:
    run([holba, "convert", "--input_path", source, "--output_path", folder / "text", "--output_type", "txt"])
    observations = perturb(folder / "text", folder / "start", zlib.crc32(str(source.parts[-3:]).encode()))
    begin = time.monotonic()
    run([holba, "adjust", "--input_path", folder / "start", "--output_path", folder / "holba", "--Bundle.config", "point",
         "--Bundle.point_loss", "trivial", "--Bundle.refine_focal_length", refine, "--Bundle.refine_extra_params", refine,
         "--Bundle.refit_others", 0, "--Solver.max_num_iterations", 200, "--Solver.function_tolerance", "1e-10",
         "--Solver.gradient_tolerance", 0, "--Solver.parameter_tolerance", "1e-12"])
    seconds = time.monotonic() - begin
    (folder / "colmap").mkdir()
    begin = time.monotonic()
    run([colmap, "bundle_adjuster", "--input_path", folder / "start", "--output_path", folder / "colmap",
         "--BundleAdjustment.refine_focal_length", refine, "--BundleAdjustment.refine_extra_params", refine,
         "--BundleAdjustment.max_num_iterations", 200, "--BundleAdjustment.function_tolerance", "1e-10",
         "--BundleAdjustment.gradient_tolerance", "1e-12", "--BundleAdjustment.parameter_tolerance", "1e-12"])
    colmap_seconds = time.monotonic() - begin
    check_that_colmap_opens(colmap, folder / "holba", folder / "opened", observations)
    costs = {name: point_cost(holba, folder / name) for name in ("start", "holba", "colmap")}
    result = {"residuals": observations, "seconds": seconds, "colmap_seconds": colmap_seconds,
              "ratio": costs["holba"]["sum_squares"] / costs["colmap"]["sum_squares"],
              **{name: cost["sum_squares"] for name, cost in costs.items()}}
    for name in ("holba", "colmap"):
        # Points behind a camera would make a smaller sum.
        result[f"missing_{name}"] = observations - costs[name]["residuals"]
    return result


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sets", nargs="*")
    parser.add_argument("--holba", required=True)
    parser.add_argument("--colmap", default="colmap")
    parser.add_argument("--data", type=pathlib.Path, required=True)
    parser.add_argument("--all", action="store_true")
    args = parser.parse_args()
    try:
        run([args.colmap, "help"])
    except FileNotFoundError:
        print(f"SKIPPED: {args.colmap} is not installed", file=sys.stderr)
        return SKIPPED
    sets = sorted(p.parent.name for p in args.data.glob("*/colmap")) if args.all else args.sets
    if not sets:
        print(f"SKIPPED: no sets named, or none in {args.data}", file=sys.stderr)
        return SKIPPED
    print(f"{'model':<32} {'observ.':>8} {'start':>12} {'colmap':>14} {'holba':>14} {'ratio - 1':>10} {'s':>6} {'colmap s':>8}")
    faults = []
    for name in sets:
        for variant, refine in VARIANTS.items():
            source = args.data / name / "colmap" / variant
            if not source.exists():
                print(f"SKIPPED: {source} is not there", file=sys.stderr)
                return SKIPPED
            with tempfile.TemporaryDirectory() as folder:
                r = compare(args.holba, args.colmap, source, refine, pathlib.Path(folder))
            print(f"{name + '/' + variant:<32} {r['residuals']:>8} {r['start']:>12.6g} {r['colmap']:>14.9g} {r['holba']:>14.9g} "
                  f"{r['ratio'] - 1:>10.1e} {r['seconds']:>6.1f} {r['colmap_seconds']:>8.1f}", flush=True)
            if not r["ratio"] <= WORST_RATIO:
                faults.append(f"{name}/{variant}: holba ends {r['ratio'] - 1:.1e} above COLMAP")
            if r["missing_holba"] > r["missing_colmap"]:
                faults.append(f"{name}/{variant}: {r['missing_holba']} observations have no image in holba's result")
    for fault in faults:
        print(fault, file=sys.stderr)
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
