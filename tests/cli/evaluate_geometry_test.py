#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""`holba evaluate_geometry` as a user meets it (its figures are tested in tests/accuracy). Environment: HOLBA, path of the
program."""

import json
import os
import pathlib
import subprocess
import sys
import tempfile
import unittest

from small_model import write_small_model

HOLBA = os.environ["HOLBA"]
# The plane z = 4 of the small model, and its two lines as edges.
MESH = """ply
format ascii 1.0
element vertex 4
property float x
property float y
property float z
element face 1
property list uchar int vertex_indices
end_header
-1 -1 4
2 -1 4
2 2 4
-1 2 4
4 0 1 2 3
"""


def holba(*words) -> subprocess.CompletedProcess:
    return subprocess.run([HOLBA, *map(str, words)], capture_output=True, text=True, timeout=120)


class EvaluateGeometry(unittest.TestCase):
    def setUp(self):
        self._temporary = tempfile.TemporaryDirectory()
        self.addCleanup(self._temporary.cleanup)
        self.folder = pathlib.Path(self._temporary.name)
        self.model, self.mesh = self.folder / "model", self.folder / "mesh.ply"
        write_small_model(self.model)
        self.mesh.write_text(MESH)

    def evaluates(self, *words) -> dict:
        result = holba("evaluate_geometry", "--json", *words)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.log = result.stderr
        return json.loads(result.stdout)

    def refuses(self, *words) -> str:
        result = holba("evaluate_geometry", *words)
        self.assertEqual((result.returncode, result.stdout), (1, ""), result.stderr)
        self.assertEqual(result.stderr.count("\n"), 1, result.stderr)
        self.assertNotIn("internal error", result.stderr)
        return result.stderr

    def test_the_json_has_what_is_promised(self):
        found = self.evaluates("--input_path", self.model, "--mesh_path", self.mesh, "--thresholds_mm", "1,2.5")
        self.assertEqual(found["points"], {"count": 2, "median_mm": 0.0, "inlier_percent": {"1": 100.0, "2.5": 100.0}})
        self.assertEqual(found["lines"], {"count": 2, "length_m": 3.0, "recall_m": {"1": 3.0, "2.5": 3.0},
                                          "precision_percent": {"1": 100.0, "2.5": 100.0}})
        self.assertEqual(found["lines_limap"]["count"], 0)  # two images see each line
        self.assertEqual(sorted(found), ["lines", "lines_limap", "points", "points_by_origin"])
        table = holba("evaluate_geometry", "--input_path", self.model, "--mesh_path", self.mesh).stdout
        self.assertIn("within 1 / 5 / 10 mm: recall 3.00 / 3.00 / 3.00 m, precision 100.0 / 100.0 / 100.0 %", table)

    def test_a_model_of_another_frame_is_warned_about_and_aligned(self):
        moved = self.folder / "moved"
        self.assertEqual(holba("transform", "--input_path", self.model, "--output_path", moved, "--scale", 2, "--rotation",
                               "0.5,0.5,0.5,0.5", "--translation", "3,4,5").returncode, 0)
        words = ("--input_path", moved, "--mesh_path", self.mesh, "--ground_truth_path", self.model)
        self.assertEqual(self.evaluates(*words)["points"]["inlier_percent"]["10"], 0.0)
        self.assertIn("--alignment brings the model into the truth's frame", self.log)
        found = self.evaluates(*words, "--alignment", "auto")
        self.assertEqual(found["points"]["inlier_percent"]["1"], 100.0)
        self.assertAlmostEqual(found["lines"]["length_m"], 3.0)
        self.assertEqual(found["edges"]["recall_percent"]["1"], 100.0)
        self.assertEqual({name: (kind["true"], kind["found"]) for name, kind in found["primitives"].items()},
                         {"VP": (1, 1), "PLANE": (1, 1)})

    def test_lengths_in_other_units(self):
        found = self.evaluates("--input_path", self.model, "--mesh_path", self.mesh, "--metres_per_unit", "0.01")
        self.assertAlmostEqual(found["lines"]["length_m"], 0.03)

    def test_what_is_wrong_is_named(self):
        model = ("--input_path", self.model)
        self.assertIn("give --mesh_path", self.refuses(*model))
        self.assertIn("two surfaces", self.refuses(*model, "--mesh_path", self.mesh, "--point_cloud_path", self.mesh))
        self.assertIn("none.ply: there is no such file", self.refuses(*model, "--mesh_path", self.folder / "none.ply"))
        self.assertIn("needs true poses", self.refuses(*model, "--mesh_path", self.mesh, "--alignment", "auto"))
        self.assertIn("--scanner_position", self.refuses(*model, "--point_cloud_path", self.mesh, "--scanner_position", "1,2"))
        cloud = self.folder / "cloud.ply"
        cloud.write_text(MESH.replace("element face 1\nproperty list uchar int vertex_indices\n", "").replace("4 0 1 2 3\n", ""))
        self.assertIn("--point_cloud_path", self.refuses(*model, "--mesh_path", cloud))
        self.assertIn("element 'edge'", self.refuses(*model, "--ground_truth_path", cloud))
        output = self.folder / "errors"
        self.assertIn("none.ply", self.refuses(*model, "--mesh_path", self.folder / "none.ply", "--output_path", output))
        self.assertFalse(output.exists())


if __name__ == "__main__":
    unittest.main(argv=sys.argv)
