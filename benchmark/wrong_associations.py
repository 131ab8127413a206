#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Wrong associations on the synthetic benchmark: errors of the holistic adjustment divided by those of points alone, for
10 to 50 % of wrong group members, lines of vanishing points and wireframe edges, with the paper's weights and with
strong ones, with the tests of associations and cameras and without. Prints a Markdown table. Standard library only;
--figure needs matplotlib.

Errors are root mean squares over cameras (rotation, position) or points, and over all seeds; beside it the worst seed
and how many seeds are worse than points alone (single seeds scatter: lines alone do that without anything wrong).
Intrinsics are held (they are known).
Example: benchmark/wrong_associations.py --num_images 50 --seeds 10 --figure docs/wrong_associations.svg
"""

import argparse
import concurrent.futures
import json
import math
import os
import pathlib
import subprocess
import sys
import tempfile

from real_sets import markdown, run

QUANTITIES = [("rotation", "rotation_rms_deg"), ("position", "position_rms"), ("points", "point_rms")]
WEIGHTS = {
    "paper": [],
    "strong": ["--Bundle.group_weight", "5", "--Bundle.wireframe_weight", "1"],
}
GATES = {"on": [], "off": ["--Bundle.gate", "0", "--Bundle.choose_weights", "0"]}
KNOWN_INTRINSICS = ["--Bundle.refine_focal_length", "0", "--Bundle.refine_extra_params", "0"]
# Errors agree to this share by convergence alone.
TIE = 1e-3

# Errors of one adjustment, in the order of QUANTITIES, and those of points alone on the same seed.
Pair = tuple[list[float], list[float]]


def cases(shares: list[float]) -> list[tuple[str, float]]:
    """(kind, share): without wrong ones the kinds are the same."""
    wrong = [(kind, share) for kind in ("random", "nearest") for share in shares if share > 0.0]
    return ([("none", 0.0)] if 0.0 in shares else []) + wrong


def errors(program: str, start: pathlib.Path, truth: pathlib.Path, result: pathlib.Path, options: list[str]) -> list[float]:
    """Root mean square errors of the adjusted model, in the order of QUANTITIES."""
    run(program, "adjust", "--input_path", start, "--output_path", result, *options, *KNOWN_INTRINSICS,
        "--Bundle.refit_others", "0", "--Solver.num_threads", "1")
    found = run(program, "evaluate", "--input_path", result, "--ground_truth_path", truth)["ground_truth"]
    return [found[name] for _, name in QUANTITIES]


def errors_of_seed(program: str, num_images: int, case: tuple[str, float], seed: int,
                   options: list[str]) -> dict[tuple[str, str], Pair]:
    """(weights, tests) -> errors."""
    kind, share = case
    words = ["--num_images", num_images, "--seed", seed, "--vps", 1, *options]
    if share > 0.0:
        words += ["--fraction_wrong_associations", share, "--wrong_associations", kind]
    with tempfile.TemporaryDirectory() as temporary:
        folder = pathlib.Path(temporary)
        made = subprocess.run([program, "synthesize", "--output_path", folder, "--quiet", *map(str, words)],
                              capture_output=True, text=True)
        if made.returncode != 0:
            sys.exit(made.stderr)
        start, truth, result = folder / "perturbed", folder / "truth", folder / "adjusted"
        points = errors(program, start, truth, result, ["--Bundle.config", "point"])
        return {(weights, gate): (errors(program, start, truth, result, weight + test), points)
                for weights, weight in WEIGHTS.items() for gate, test in GATES.items()}


def overall(pairs: list[Pair]) -> list[float]:
    """Root mean square over the seeds by that of points alone."""
    return [math.sqrt(sum(e[k] ** 2 for e, _ in pairs) / sum(p[k] ** 2 for _, p in pairs)) for k in range(len(QUANTITIES))]


def worst(pairs: list[Pair]) -> list[float]:
    return [max(e[k] / p[k] for e, p in pairs) for k in range(len(QUANTITIES))]


def row(case: tuple[str, float], weights: str, gate: str, pairs: list[Pair]) -> list[str]:
    counts = [sum(e[k] > (1.0 + TIE) * p[k] for e, p in pairs) for k in range(len(QUANTITIES))]
    kind, share = case
    return [f"{share:.0%}", kind, weights, gate, *(f"{ratio:.3f}" for ratio in overall(pairs)),
            *(f"{ratio:.2f} ({count})" for ratio, count in zip(worst(pairs), counts))]


def draw(path: pathlib.Path, table: dict, shares: list[float], num_images: int) -> None:
    """Ratios of the points' and positions' errors against the share of wrong associations."""
    import matplotlib
    matplotlib.use("Agg")
    from matplotlib import pyplot, ticker

    # Text stays text, and the same input gives the same file.
    matplotlib.rcParams.update({"svg.fonttype": "none", "svg.hashsalt": "holba", "font.size": 9})
    styles = {("paper", "on"): ("#1b6ca8", "-", "o"), ("paper", "off"): ("#1b6ca8", ":", "o"),
              ("strong", "on"): ("#c44e52", "-", "D"), ("strong", "off"): ("#c44e52", ":", "D")}
    figure, grid = pyplot.subplots(2, 2, figsize=(9, 6), sharex=True, sharey="row")
    for column, kind in enumerate(("random", "nearest")):
        for line, quantity in enumerate((2, 1)):
            axes = grid[line][column]
            axes.axhline(1.0, color="#555555", linewidth=0.8)
            for (weights, gate), (colour, dash, marker) in styles.items():
                xs, ratios, worsts = [], [], []
                for share in shares:
                    pairs = table.get((("none", 0.0) if share == 0.0 else (kind, share), weights, gate))
                    if pairs is None:
                        continue
                    xs.append(100.0 * share)
                    ratios.append(overall(pairs)[quantity])
                    worsts.append(worst(pairs)[quantity])
                axes.plot(xs, ratios, color=colour, linestyle=dash, marker=marker, markersize=4,
                          label=f"{weights} weights, tests {gate}")
                axes.plot(xs, worsts, color=colour, linestyle="none", marker="_", markersize=8)
            axes.set_yscale("log")
            axes.yaxis.set_major_locator(ticker.FixedLocator([0.8, 0.9, 1.0, 1.2, 1.5, 2.0, 3.0]))
            axes.yaxis.set_major_formatter(ticker.FormatStrFormatter("%.2g"))
            axes.yaxis.set_minor_locator(ticker.NullLocator())
            axes.grid(color="#dddddd", linewidth=0.6, which="both")
            if line == 0:
                axes.set_title(f"{kind} wrong associations" if kind == "random" else "nearest non-members", fontsize=10)
            else:
                axes.set_xlabel("wrong associations, %")
            if column == 0:
                axes.set_ylabel(f"{QUANTITIES[quantity][0]}: RMS error / points alone")
    handles, labels = grid[0][0].get_legend_handles_labels()
    figure.suptitle(f"{num_images} images; marks: worst seed", fontsize=9)
    figure.legend(handles, labels, loc="lower center", ncols=4, frameon=False, fontsize=8)
    figure.tight_layout(rect=(0, 0.05, 1, 1))
    figure.savefig(path, metadata={"Date": None} if path.suffix == ".svg" else {}, dpi=150)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--num_images", type=int, default=50, help="size of the scenes (default: 50)")
    parser.add_argument("--seeds", type=int, default=10, help="scenes of every case (default: 10)")
    parser.add_argument("--shares", default="0,0.1,0.3,0.5", help="of wrong associations (default: 0,0.1,0.3,0.5)")
    parser.add_argument("--holba", default=str(pathlib.Path(__file__).parent.parent / "build" / "bin" / "holba"),
                        help="the program (default: build/bin/holba)")
    parser.add_argument("--figure", type=pathlib.Path, help="draw the ratios here (.svg, .png)")
    parser.add_argument("--json", type=pathlib.Path, help="write every error here")
    parser.add_argument("options", nargs="*", help="further options of `holba synthesize`, after --")
    arguments = parser.parse_args()
    shares = [float(share) for share in arguments.shares.split(",")]

    table: dict[tuple[tuple[str, float], str, str], list[Pair]] = {}
    with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
        for case in cases(shares):
            print(f"{case[1]:.0%} {case[0]}", file=sys.stderr)
            seeds = pool.map(lambda seed: errors_of_seed(arguments.holba, arguments.num_images, case, seed,
                                                         arguments.options), range(arguments.seeds))
            for found in seeds:
                for (weights, gate), pair in found.items():
                    table.setdefault((case, weights, gate), []).append(pair)

    header = ["wrong", "kind", "weights", "tests", *(name for name, _ in QUANTITIES),
              *(f"worst {name}" for name, _ in QUANTITIES)]
    # With the tests first, weights together, then by share.
    ordered = sorted(table, key=lambda key: (key[2] == "off", key[1], key[0][1], key[0][0] == "nearest"))
    print(f"Errors by those of points alone, {arguments.num_images} images: root mean square over {arguments.seeds} seeds; "
          "worst seed (seeds that are worse than points alone):\n")
    print(markdown(header, [row(*key, table[key]) for key in ordered], num_left=4))
    if arguments.json:
        arguments.json.write_text(json.dumps(
            [{"kind": case[0], "share": case[1], "weights": weights, "tests": gate, "errors": [e for e, _ in pairs],
              "errors_of_points_alone": [p for _, p in pairs]} for (case, weights, gate), pairs in table.items()], indent=1))
    if arguments.figure:
        draw(arguments.figure, table, shares, arguments.num_images)


if __name__ == "__main__":
    main()
