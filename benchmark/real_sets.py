#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Adjusts holistic models of real image sets with every configuration and prints Markdown tables: pose AUC against
the truth, and the cost of every term before and after with everything. Standard library only.

DATA/SET/holistic is a model folder, DATA/SET/gt one with the true poses. Intrinsics are held (they are known).
Example: benchmark/real_sets.py --data DATA --sets entry_p10,fountain_p11
"""

import argparse
import json
import pathlib
import subprocess
import sys
import tempfile

# Title, options of `holba adjust`. The first two differ in the loss only: what robustness alone buys is seen there.
CONFIGS = [
    ("Point, squared loss", ["--Bundle.config", "point", "--Bundle.point_loss", "trivial"]),
    ("Point", ["--Bundle.config", "point"]),
    ("Point-Line", ["--Bundle.config", "point_line"]),
    ("Groups", ["--Bundle.config", "groups"]),
    ("Holistic", ["--Bundle.config", "holistic"]),
]
KNOWN_INTRINSICS = ["--Bundle.refine_focal_length", "0", "--Bundle.refine_extra_params", "0"]
THRESHOLDS_DEG = ["0.5", "1", "3", "5"]


def markdown(header: list[str], rows: list[list[str]], num_left: int = 2) -> str:
    """A Markdown table with columns of equal width, the first num_left of them left-aligned."""
    widths = [max(3, *(len(row[i]) for row in [header, *rows])) for i in range(len(header))]

    def line(cells: list[str]) -> str:
        return "| " + " | ".join(c.ljust(w) if i < num_left else c.rjust(w) for i, (c, w) in enumerate(zip(cells, widths))) + " |"

    rule = "| " + " | ".join("-" * w if i < num_left else "-" * (w - 1) + ":" for i, w in enumerate(widths)) + " |"
    return "\n".join([line(header), rule, *map(line, rows)])


def run(program: str, *words) -> dict:
    """Result of `holba ... --json`. Ends this program with holba's message if it fails."""
    result = subprocess.run([program, *map(str, words), "--json", "--quiet"], capture_output=True, text=True)
    if result.returncode != 0:
        sys.exit(f"{' '.join(map(str, words))}\n{result.stderr}")
    return json.loads(result.stdout)


def auc_cells(program: str, model: pathlib.Path, truth: pathlib.Path) -> list[str]:
    auc = run(program, "evaluate_poses", "--input_path", model, "--ground_truth_path", truth,
              "--thresholds_deg", ",".join(THRESHOLDS_DEG))["auc"]
    return [f"{auc[threshold]:.1f}" for threshold in THRESHOLDS_DEG]


def parser_of_sets(description: str, sets: list[str] | tuple[str, ...]) -> argparse.ArgumentParser:
    """Of scripts that refine models of sets."""
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=pathlib.Path, required=True, help="folder of the image sets")
    parser.add_argument("--sets", default=",".join(sets), help="names, separated by commas (default: %(default)s)")
    parser.add_argument("--holba", default=str(pathlib.Path(__file__).parent.parent / "build" / "bin" / "holba"),
                        help="the program (default: build/bin/holba)")
    parser.add_argument("--output", type=pathlib.Path, help="keep models and databases here")
    parser.add_argument("options", nargs="*", help="further options of `holba refine`, after --")
    return parser


def term_rows(name: str, summary: dict) -> list[list[str]]:
    rows = []
    for term, costs in summary["terms"].items():
        rows.append([name, term, str(costs["residuals"]), f"{costs['cost_initial']:.1f}", f"{costs['cost_final']:.1f}",
                     f"{costs['auto_scale']:.2f}" if "auto_scale" in costs else "-"])
    cost = summary["cost"]
    rows.append([name, "all", "", f"{cost['initial']:.1f}", f"{cost['final']:.1f}", "-"])
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=pathlib.Path, required=True, help="folder of the image sets")
    parser.add_argument("--sets", help="names, separated by commas (default: all with SET/holistic and SET/gt)")
    parser.add_argument("--holba", default=str(pathlib.Path(__file__).parent.parent / "build" / "bin" / "holba"),
                        help="the program (default: build/bin/holba)")
    parser.add_argument("--output", type=pathlib.Path, help="keep the adjusted models here")
    parser.add_argument("options", nargs="*", help="further options of `holba adjust`, after --")
    arguments = parser.parse_args()

    if arguments.sets:
        names = arguments.sets.split(",")
    else:
        names = sorted(p.parent.name for p in arguments.data.glob("*/holistic") if (p.parent / "gt").is_dir())
    if not names:
        parser.error(f"no set with a folder holistic and a folder gt in {arguments.data}")

    auc_rows, cost_rows, run_rows = [], [], []
    with tempfile.TemporaryDirectory() as temporary:
        output = arguments.output or pathlib.Path(temporary)
        for name in names:
            start, truth = arguments.data / name / "holistic", arguments.data / name / "gt"
            auc_rows.append([name, "input", *auc_cells(arguments.holba, start, truth)])
            for title, options in CONFIGS:
                print(f"{name}: {title}", file=sys.stderr)
                model = output / name / title.lower().replace(", ", "_").replace(" ", "_")
                summary = run(arguments.holba, "adjust", "--input_path", start, "--output_path", model, *options,
                              *KNOWN_INTRINSICS, *arguments.options)
                auc_rows.append([name, title, *auc_cells(arguments.holba, model, truth)])
                run_rows.append([name, title, str(summary["iterations"]), str(summary["rounds"]),
                                 f"{summary['seconds']['total']:.1f}", summary["stop_reason"]])
                if title == "Holistic":
                    cost_rows += term_rows(name, summary)
    print("Pose AUC in % (known intrinsics):\n")
    print(markdown(["set", "configuration", *(f"@{t} deg" for t in THRESHOLDS_DEG)], auc_rows))
    print("\nHolistic: robustified, weighted cost of every term with the losses of the end:\n")
    print(markdown(["set", "term", "residuals", "before", "after", "Cauchy scale, px"], cost_rows))
    print("\nIterations (of all rounds) and seconds:\n")
    print(markdown(["set", "configuration", "iterations", "rounds", "seconds", "stopped"], run_rows))


if __name__ == "__main__":
    main()
