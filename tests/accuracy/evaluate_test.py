#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""`holba evaluate` against evaluate_reference.py.

    evaluate_test.py HOLBA synthetic CAMERA_MODEL RIG_SIZE   a scene with every type of group that synthesize makes
    evaluate_test.py HOLBA real MODEL_DIR                    a text model; exit status 77 where it is missing
    evaluate_test.py HOLBA sensitive                         the comparison notices small changes of each file"""

import pathlib
import re
import subprocess
import sys
import tempfile

import evaluate_reference as reference

SKIPPED = 77


def synthesise(holba: str, folder: pathlib.Path, camera_model: str, rig_size: int) -> pathlib.Path:
    subprocess.run([holba, "synthesize", "--output_path", folder, "--output_type", "txt", "--num_images", "20", "--vps", "1",
                    "--primitives", "1", "--camera_model", camera_model, "--rig_size", str(rig_size)],
                   check=True, capture_output=True)
    return folder / "perturbed"


def compare(holba: str, model: pathlib.Path) -> list[str]:
    output = subprocess.run([holba, "evaluate", "--input_path", model, "--json"], check=True, capture_output=True, text=True)
    return reference.compare(reference.evaluate(reference.Model(model)), reference.json.loads(output.stdout))


def synthetic(holba: str, camera_model: str, rig_size: str) -> list[str]:
    with tempfile.TemporaryDirectory() as name:
        model = synthesise(holba, pathlib.Path(name), camera_model, int(rig_size))
        kinds = {kind for kind, *_ in reference.Model(model).groups.values()}
        expected = {"VP", "PLANE", "SPHERE", "CYLINDER", "CONE", "ELLIPSOID", "CUBOID"}
        faults = compare(holba, model) + compare(holba, model.parent / "truth")
        if kinds != expected:
            faults.append(f"the scene has groups {sorted(kinds)}, not {sorted(expected)}")
        if (model / "rigs.txt").exists() != (int(rig_size) > 1):
            faults.append("rigs.txt is there without need, or missing")
    return faults


def sensitive(holba: str) -> list[str]:
    """A real of a file changed by 1e-4 of itself must show in the terms that it enters: the reference is no echo."""
    faults = []
    with tempfile.TemporaryDirectory() as name:
        model = synthesise(holba, pathlib.Path(name), "RADIAL", 1)
        before = reference.evaluate(reference.Model(model))["terms"]
        for file, field, terms in (("cameras.txt", 4, {"point", "line", "group_point", "group_line"}),
                                   ("points3D.txt", 2, {"point", "group_point"}),
                                   ("lines3D.txt", 5, {"line", "group_line"}),
                                   ("groups3D.txt", 3, {"group_point"})):
            text = (model / file).read_text()

            def bend(match):
                words = match.group().split(" ")
                words[field] = repr(float(words[field]) * (1 + 1e-4))
                return " ".join(words)

            (model / file).write_text(re.sub(r"^\d.*$", bend, text, flags=re.MULTILINE))
            after = reference.evaluate(reference.Model(model))["terms"]
            (model / file).write_text(text)
            changed = {t for t in reference.TERMS
                       if abs(after[t]["sum_squares"] - before[t]["sum_squares"]) > 1e-9 * before[t]["sum_squares"]}
            if not terms <= changed:
                faults.append(f"a change of {file} is seen in {sorted(changed)} only")
    return faults


def main() -> int:
    holba, what, *rest = sys.argv[1:]
    if what == "real" and not pathlib.Path(rest[0]).exists():
        print(f"SKIPPED: {rest[0]} is not there", file=sys.stderr)
        return SKIPPED
    if what == "real":
        faults = compare(holba, pathlib.Path(rest[0]))
    elif what == "synthetic":
        faults = synthetic(holba, *rest)
    else:
        faults = sensitive(holba)
    for fault in faults:
        print(fault, file=sys.stderr)
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
