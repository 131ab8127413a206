#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Models of which the program must doubt something. Environment: HOLBA, path of the program; HOLBA_DATA_DIR, folder
with reports/ (status 77, skipped, where it is missing)."""

import os
import pathlib
import subprocess
import sys
import tempfile
import unittest

HOLBA = os.environ["HOLBA"]
REPORTS = pathlib.Path(os.environ.get("HOLBA_DATA_DIR", "")) / "reports"


def holba(*words) -> subprocess.CompletedProcess:
    return subprocess.run([HOLBA, *map(str, words)], capture_output=True, text=True, timeout=120)


class Doubts(unittest.TestCase):
    def setUp(self):
        temporary = tempfile.TemporaryDirectory()
        self.addCleanup(temporary.cleanup)
        self.output = pathlib.Path(temporary.name) / "output"

    def test_what_one_image_sees_does_not_pull_cameras(self):
        case = REPORTS / "single-view-points"
        errors = []
        for model in ("without_them", "half_single"):
            output = self.output.with_name(model)
            result = holba("adjust", "--input_path", case / model, "--output_path", output)
            self.assertEqual(result.returncode, 0, result.stderr)
            self.assertEqual("50 points and 0 lines are seen by fewer than two images" in result.stderr,
                             model == "half_single", result.stderr)
            table = holba("evaluate", "--input_path", output, "--ground_truth_path", case / "truth").stdout
            errors.append({line.split()[0]: float(line.split()[1]) for line in table.splitlines()
                           if line.startswith(("rotation_rms", "position_rms"))})
        self.assertEqual(errors[0], errors[1])
        self.assertAlmostEqual(errors[0]["rotation_rms_deg"], 0.235, delta=0.001)
        self.assertAlmostEqual(errors[0]["position_rms"], 0.040, delta=0.001)

    def test_points_behind_all_cameras_are_refused(self):
        model = REPORTS / "all-behind" / "opengl"
        result = holba("adjust", "--input_path", model, "--output_path", self.output)
        self.assertEqual((result.returncode, result.stdout), (1, ""), result.stderr)
        self.assertRegex(result.stderr, "588 of 588 observations are of points behind their camera, so that nothing can be "
                                        "adjusted; read as poses of cameras that look along -z with y up")
        self.assertFalse(self.output.exists())
        result = holba("evaluate", "--input_path", model)
        self.assertEqual(result.returncode, 0)
        self.assertRegex(result.stderr, "588 of 588 observations are of points behind their camera")


if __name__ == "__main__":
    if not REPORTS.is_dir():
        print(f"SKIPPED, NOT TESTED: no reports at {REPORTS} (set HOLBA_DATA_DIR)")
        sys.exit(77)
    unittest.main()
