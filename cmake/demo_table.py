#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Prints the table of demo.sh from the files CONFIG.json that `holba evaluate --json` wrote to a folder."""

import json
import pathlib
import sys

ROWS = [("start", "start"), ("point", "point"), ("point-line", "point_line"), ("groups", "groups"),
        ("holistic", "holistic")]
# Title, unit, key of `ground_truth`. Lengths are in model units.
COLUMNS = [("rotation", "deg", "rotation_rms_deg"), ("position", "", "position_rms"),
           ("point", "", "point_rms"), ("line dir", "deg", "line_direction_rms_deg"),
           ("line dist", "", "line_distance_rms"), ("plane nrm", "deg", "plane_normal_rms_deg"),
           ("plane off", "", "plane_offset_rms")]


def cell(value: float | None) -> str:
    return "-" if value is None else f"{value:.4g}"


def bought(errors: dict[str, dict]) -> str:
    """One sentence: how the last row compares with classical bundle adjustment (the row `point`)."""
    parts = []
    for name, key in [("camera position", "position_rms"), ("camera rotation", "rotation_rms_deg"),
                      ("3D point", "point_rms"), ("3D line", "line_distance_rms")]:
        before, after = errors["point"].get(key), errors["holistic"].get(key)
        if not before or after is None:
            continue
        percent = 100 * (1 - after / before)
        parts.append(f"the {name} error is {abs(percent):.0f} % {'smaller' if percent >= 0 else 'larger'}")
    if not parts:
        return "The truth holds nothing that both adjustments can be compared by."
    return "With all structure, compared with points alone, " + ", ".join(parts) + "."


def main(folder: pathlib.Path) -> None:
    errors = {}
    for _, config in ROWS:
        errors[config] = json.loads((folder / f"{config}.json").read_text())["ground_truth"]
    lines = [[""] + [title for title, _, _ in COLUMNS], [""] + [unit for _, unit, _ in COLUMNS]]
    for title, config in ROWS:
        lines.append([title] + [cell(errors[config].get(key)) for _, _, key in COLUMNS])
    widths = [max(len(line[i]) for line in lines) for i in range(len(lines[0]))]
    print("Root mean square error against the truth (lengths in model units):")
    for line in lines:
        first, *rest = line
        cells = [first.ljust(widths[0])] + [x.rjust(w) for x, w in zip(rest, widths[1:])]
        print("  ".join(cells).rstrip())
    print(bought(errors))


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(f"usage: {sys.argv[0]} FOLDER")
    main(pathlib.Path(sys.argv[1]))
