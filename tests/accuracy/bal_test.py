#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""`holba adjust` on a problem of Bundle Adjustment in the Large reaches its best known cost (half sum of squares, all
nine parameters of every camera free).

    bal_test.py HOLBA FILE BEST_KNOWN_COST      exit status 77: the file is not there"""

import json
import pathlib
import subprocess
import sys
import tempfile


def main() -> int:
    holba, problem, best = sys.argv[1], pathlib.Path(sys.argv[2]), float(sys.argv[3])
    if not problem.exists():
        print(f"SKIPPED: {problem} is not there", file=sys.stderr)
        return 77
    with tempfile.TemporaryDirectory() as folder:
        output = pathlib.Path(folder) / "adjusted.txt"
        result = subprocess.run([holba, "adjust", "--input_path", problem, "--output_path", output, "--json",
                                 "--Solver.max_num_iterations", "200", "--Solver.function_tolerance", "1e-8"],
                                capture_output=True, text=True)
        if result.returncode != 0:
            print(result.stderr[-2000:], file=sys.stderr)
            return 1
        summary = json.loads(result.stdout)
        # The file that was written has the cost that was reported.
        evaluated = subprocess.run([holba, "evaluate", "--input_path", output, "--json"], check=True, capture_output=True,
                                   text=True)
        written = 0.5 * json.loads(evaluated.stdout)["terms"]["point"]["sum_squares"]
    cost, terms = summary["cost"]["final"], summary["terms"]["point"]
    print(f"best known {best:.8g}, reached {cost:.8g}, written {written:.8g} in {summary['iterations']} iterations, "
          f"{summary['seconds']['total']:.1f} s; absent {terms['absent']} of {terms['residuals']}")
    if terms["absent"] > 0:
        print("some observations do not count", file=sys.stderr)
        return 1
    return 0 if cost <= best * (1 + 1e-4) and abs(written - cost) <= 1e-6 * cost else 1


if __name__ == "__main__":
    sys.exit(main())
