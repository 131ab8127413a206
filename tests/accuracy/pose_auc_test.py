#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""`holba evaluate_poses` agrees with pose_auc.py, the independent program beside the real image sets, to 0.01 % on every
model of every set that has true poses: registered images, AUC in both conventions, medians.

    pose_auc_test.py HOLBA DATA      exit status 77: there are no sets in DATA"""

import json
import pathlib
import subprocess
import sys
import tempfile

THRESHOLDS = "0.5,1,3,5,10"
TOLERANCE = 0.01


def run(*words) -> str:
    result = subprocess.run([*map(str, words)], capture_output=True, text=True)
    if result.returncode != 0:
        sys.exit(f"{' '.join(map(str, words))}\n{result.stderr[-2000:]}")
    return result.stdout


def compare(holba: str, data: pathlib.Path, truth: pathlib.Path, model: pathlib.Path) -> list[str]:
    """Faults, and a line on stdout."""
    faults = []
    for convention, flags in (("step", []), ("trapezoid", ["--trapezoid"])):
        ours = json.loads(run(holba, "evaluate_poses", "--input_path", model, "--ground_truth_path", truth,
                              "--thresholds_deg", THRESHOLDS, "--auc_convention", convention, "--json"))
        theirs = json.loads(run(sys.executable, "-B", data / "pose_auc.py", truth, model, "--thresholds", THRESHOLDS,
                                "--json", *flags))
        same = {key: (ours[key], theirs[key]) for key in ("registered", "images", "pairs", "registered_pairs")}
        near = {f"auc @{t}": (ours["auc"][t], theirs["auc"][t]) for t in theirs["auc"]}
        if theirs["registered_pairs"] > 0:
            for kind in ("rotation_deg", "translation_deg"):
                near[kind] = (ours[kind]["median"], theirs[kind]["median"])
        faults += [f"{model}, {convention}: {name} {a} here, {b} there" for name, (a, b) in same.items() if a != b]
        faults += [f"{model}, {convention}: {name} {a} here, {b} there" for name, (a, b) in near.items()
                   if not abs(a - b) <= TOLERANCE]
    print(f"{truth.parent.name:<24} {model.name:<16} {ours['registered']:>3} of {ours['images']:>3} images, AUC @1 "
          f"{ours['auc']['1']:.2f}", flush=True)
    return faults


def main() -> int:
    holba, data = sys.argv[1], pathlib.Path(sys.argv[2])
    truths = sorted(data.glob("*/gt/images.txt"))
    if not (data / "pose_auc.py").exists() or not truths:
        print(f"SKIPPED, NOT TESTED: no pose_auc.py and sets with gt in {data}", file=sys.stderr)
        return 77
    faults, num_compared = [], 0
    for images in truths:
        truth = images.parent
        records = [line for line in images.read_text().splitlines() if line and not line.startswith("#")]
        if len(records) < 2:
            continue  # a single instant, or intrinsics only
        found = sorted(truth.parent.glob("colmap/*")) + sorted(truth.parent.glob("holistic"))
        for source in (path for path in found if path.is_dir()):
            with tempfile.TemporaryDirectory() as folder:
                model = pathlib.Path(folder) / source.name
                # COLMAP's mapper may have left several models.
                for part in sorted(p for p in source.iterdir() if p.is_dir()) or [source]:
                    target = model if part == source else model / part.name
                    run(holba, "convert", "--input_path", part, "--output_path", target, "--output_type", "txt")
                faults += compare(holba, data, truth, model)
                num_compared += 1
    for fault in faults:
        print(fault, file=sys.stderr)
    print(f"{num_compared} models compared")
    return 1 if faults or num_compared == 0 else 0


if __name__ == "__main__":
    sys.exit(main())
