# SPDX-License-Identifier: BSD-3-Clause
"""What registration.py and two_view.py share: `holba bench` on views in a file (apps/bench/view_blocks.h)."""

import json
import pathlib
import subprocess
import tempfile

import numpy as np


def matrix_of(q):
    w, x, y, z = q
    return np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ])


def bench_poses(holba, benchmark, kind, camera, blocks, number_format, options):
    """Poses (rotation and translation, or None) and microseconds of processor time, one per block. `camera`: width,
    height, fx, fy, cx, cy of all; `blocks`: an array of rows each."""
    with tempfile.TemporaryDirectory() as folder:
        path = pathlib.Path(folder) / "views.txt"
        with open(path, "w") as file:
            for rows in blocks:
                file.write(" ".join(map(str, [kind, *camera, len(rows)])) + "\n")
                np.savetxt(file, rows, fmt=number_format)
        command = [holba, "bench", "--benchmark", benchmark, "--input_path", str(path), "--json", *options]
        results = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)["results"]
    poses = [(matrix_of(r["qvec"]), np.array(r["tvec"])) if "qvec" in r else None for r in results]
    return poses, [r["cpu_us"] for r in results]
