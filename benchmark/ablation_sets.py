#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Runs `holba refine` on real image sets with each family of terms left out in turn, with weights chosen and as given,
and with the 3D instead of the 2D form of groups and wireframe at several weights; prints a Markdown table of pose AUC.
Standard library only.

DATA/SET/images are the photographs, DATA/SET/colmap/pinhole_fixed COLMAP's model with the true intrinsics, which are
held, DATA/SET/gt a model with the true poses. What is found in photographs is kept in one database per set, so that it
is found once. A family is off when its weight is 0; lines, which all but planes of points hang on, and corners, which
share their weight with no option, are not made at all.
Example: benchmark/ablation_sets.py --data DATA --sets entry_p10,fountain_p11 --output RUNS
"""

import pathlib
import sys
import tempfile

from real_sets import KNOWN_INTRINSICS, THRESHOLDS_DEG, auc_cells, markdown, parser_of_sets, run

# Truth is surveyed (buildings) or exact (renderings): models of other programs are no judge of fractions of a degree.
SETS = ["entry_p10", "fountain_p11", "herzjesu_p8", "herzjesu_p25", "greyroom_pinhole", "greyroom_plain",
        "greyroom_fisheye"]
NUM_THRESHOLDS = 3  # of THRESHOLDS_DEG; beyond 3 degrees nothing differs
NONE = "1000"  # images that must see a feature, more than there are
FAMILIES = [
    # No line has 100 images, the option's largest value.
    ("lines", ["--Lines.min_images", "100"]),
    ("corners and junctions", ["--CornerTracks.min_num_images", NONE, "--Junctions.min_num_images", NONE]),
    ("planes", ["--Bundle.group_weight", "0"]),
    ("VPs", ["--Bundle.vp_weight", "0"]),
    ("relations", ["--Bundle.relation_weight", "0"]),
    ("wireframe", ["--Bundle.wireframe_weight", "0"]),
]
MODES = [("chosen", []), ("as given", ["--Bundle.choose_weights", "0"])]
WEIGHTS_3D = ["1", "10", "100", "1000"]


def configurations() -> list[tuple[str, str, list[str]]]:
    """Weights, title and options of `holba refine` of every row."""
    rows = [("-", "Point", ["--Bundle.config", "point"])]
    for weights, mode in MODES:
        rows.append((weights, "**all on**", mode))
        rows += [(weights, f"{family} off", mode + options) for family, options in FAMILIES]
    for weight in WEIGHTS_3D:
        rows.append(("as given", f"3D form, weight {weight}",
                     [*MODES[1][1], "--Bundle.group_form", "3d", "--Bundle.group_3d_weight", weight,
                      "--Bundle.wireframe_form", "3d", "--Bundle.wireframe_3d_weight", weight]))
    return rows


def main() -> None:
    arguments = parser_of_sets(__doc__, SETS).parse_args()

    names = arguments.sets.split(",")
    rows = configurations()
    cells = {}  # AUC at every threshold, by row and set; row -1 is the input
    with tempfile.TemporaryDirectory() as temporary:
        folder = arguments.output or pathlib.Path(temporary)
        folder.mkdir(parents=True, exist_ok=True)
        for name in names:
            start = arguments.data / name / "colmap" / "pinhole_fixed"
            truth = arguments.data / name / "gt"
            cells[-1, name] = auc_cells(arguments.holba, start, truth)[:NUM_THRESHOLDS]
            for i, (weights, title, options) in enumerate(rows):
                model = folder / f"{name}_{i:02d}"
                run(arguments.holba, "refine", "--image_path", arguments.data / name / "images", "--input_path", start,
                    "--output_path", model, "--database_path", folder / f"{name}.db", "--num_pictures", "0",
                    *KNOWN_INTRINSICS, "--Bundle.refine_principal_point", "0", *options, *arguments.options)
                cells[i, name] = auc_cells(arguments.holba, model, truth)[:NUM_THRESHOLDS]
                print(f"{name}, weights {weights}, {title}: {' / '.join(cells[i, name])}", file=sys.stderr)

    def table_row(i: int, weights: str, title: str) -> list[str]:
        means = [sum(float(cells[i, name][t]) for name in names) / len(names) for t in range(NUM_THRESHOLDS)]
        return [weights, title, " / ".join(f"{mean:.1f}" for mean in means)] + [" / ".join(cells[i, n]) for n in names]

    print(f"Pose AUC in % @{' / '.join(THRESHOLDS_DEG[:NUM_THRESHOLDS])} deg, known intrinsics:\n")
    print(markdown(["weights", "", "mean", *names],
                   [table_row(-1, "-", "COLMAP (input)")] + [table_row(i, *row[:2]) for i, row in enumerate(rows)]))


if __name__ == "__main__":
    main()
