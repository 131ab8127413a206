#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Draws results of `holba bench --benchmark solver --json`: for every problem the time of one iteration and the
time to 0.1 % above the least cost, of the best of each family of solvers, on logarithmic axes. Needs matplotlib.

Example: holba bench --benchmark solver --json > solver.json; benchmark/plot_solver.py solver.json docs/solver.svg
"""

import argparse
import json
import pathlib

import matplotlib

matplotlib.use("Agg")
from matplotlib import pyplot  # noqa: E402: the backend is chosen first

# Title, beginnings of the names of its solvers, whether their steps are exact, colour, marker. A family's time is that
# of its best member.
FAMILIES = [
    ("native, factorised", ("native",), True, "#1b6ca8", "o"),
    ("native, iterative", ("native",), False, "#1b6ca8", "D"),
    ("Ceres, dense", ("ceres_dense", "plain_ceres_dense"), True, "#c44e52", "o"),
    ("Ceres, sparse", ("ceres_sparse", "plain_ceres_sparse"), True, "#dd8452", "o"),
    ("Ceres, iterative", ("ceres_iterative", "plain_ceres_iterative"), False, "#937860", "D"),
]
FLOOR = "#555555"
INCHES_PER_PROBLEM = 0.75


def least(problem: dict, prefixes: tuple[str, ...], is_exact: bool, key: str) -> float | None:
    """Least number `key` of the problem's solvers of a family, times to a cost with the time of building the problem.
    None: none of them has it."""
    values = [s[key] + (s["build_problem_seconds"] if key.startswith("seconds_to") else 0.0) for s in problem["solvers"]
              if s["solver"].startswith(prefixes) and s.get("is_exact") == is_exact and s.get(key)]
    return min(values, default=None)


def text_of(milliseconds: float) -> str:
    return f"{milliseconds:.0f}" if milliseconds >= 100 else f"{milliseconds:.3g}"


def draw(axes, problems: list[dict], key: str, title: str, floors: list[float] | None) -> None:
    """Dots, one row for each problem and within it one for each family; `floors` are marked, in milliseconds."""
    step = 0.8 / len(FAMILIES)
    for row in range(1, len(problems)):
        axes.axhline(row - 0.5, color="#eeeeee", linewidth=0.8)
    for number, (name, prefixes, is_exact, colour, marker) in enumerate(FAMILIES):
        points = []
        for row, problem in enumerate(problems):
            seconds = least(problem, prefixes, is_exact, key)
            if seconds is not None:
                points.append((1e3 * seconds, row + (number - (len(FAMILIES) - 1) / 2) * step))
        axes.scatter([x for x, _ in points], [y for _, y in points], s=28, color=colour, marker=marker, label=name,
                     facecolor=colour if is_exact else "white")
        for x, y in points:
            axes.annotate(text_of(x), (x, y), xytext=(5, 0), textcoords="offset points", va="center", fontsize=7)
    if floors:
        for row, floor in enumerate(floors):
            label = "floor of a factorised step" if row == 0 else None
            axes.plot([floor, floor], [row - 0.42, row + 0.42], color=FLOOR, linewidth=1.2, linestyle=":", label=label)
    axes.set_xscale("log")
    axes.margins(x=0.12)
    axes.set_title(title, fontsize=10)
    axes.grid(axis="x", which="major", color="#dddddd", linewidth=0.6)
    axes.set_axisbelow(True)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("input", type=pathlib.Path, nargs="+", help="what the benchmark printed, of one run or several")
    parser.add_argument("output", type=pathlib.Path, help="picture to write: .svg, .png or .pdf")
    arguments = parser.parse_args()
    runs = [json.loads(path.read_text())["results"] for path in arguments.input]
    problems = [problem for run in runs for problem in run["problems"]]
    if not problems:
        parser.error("no problems")
    peak = max(run["machine"]["peak_gflops_all_threads"] for run in runs)
    floors = [1e-6 * p["flops"]["total"] / peak for p in problems]

    # Text stays text, and the same input gives the same file.
    matplotlib.rcParams.update({"svg.fonttype": "none", "svg.hashsalt": "holba", "font.size": 9})
    height = 1.2 + INCHES_PER_PROBLEM * len(problems)
    figure, (left, right) = pyplot.subplots(1, 2, figsize=(11, height), sharey=True)
    draw(left, problems, "seconds_per_iteration", "one iteration, ms", floors)
    draw(right, problems, "seconds_to_01_percent", "to 0.1 % above the least cost, ms", None)
    left.set_yticks(range(len(problems)), [p["name"] for p in problems])
    left.set_ylim(len(problems) - 0.5, -0.5)  # from the top down
    handles, labels = left.get_legend_handles_labels()
    figure.legend(handles, labels, loc="lower center", ncols=len(labels), frameon=False, fontsize=8)
    figure.tight_layout(rect=(0, 0.4 / height, 1, 1))
    metadata = {"Date": None} if arguments.output.suffix == ".svg" else {}
    figure.savefig(arguments.output, metadata=metadata, dpi=150)


if __name__ == "__main__":
    main()
