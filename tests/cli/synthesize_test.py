#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Databases of `holba synthesize`, mapped by COLMAP and by holba. Environment: as cli_test.py."""

import json
import shutil
import subprocess
import unittest

from cli_test import Case


class Synthesize(Case):
    def setUp(self):
        super().setUp()
        self.database, self.truth = self.folder / "a.db", self.folder / "truth"
        self.make(self.database, self.truth)

    def make(self, database, truth):
        self.succeeds("synthesize", "--database_path", database, "--output_path", truth, "--num_images", 24, "--seed", 1,
                      "--Database.scene", "sphere", "--Database.points_per_image", 400)

    def assert_poses_are_right(self, models):
        errors = json.loads(self.succeeds("evaluate_poses", "--input_path", models, "--ground_truth_path", self.truth, "--json"))
        self.assertEqual(errors["registered"], 24)
        self.assertGreater(errors["auc"]["1"], 80)

    def test_the_same_options_give_the_same_bytes(self):
        other = self.folder / "b.db"
        self.make(other, self.folder / "other")
        self.assertEqual(self.database.read_bytes(), other.read_bytes())

    def test_colmap_maps_it(self):
        colmap = shutil.which("colmap")
        if not colmap:
            self.skipTest("SKIPPED, NOT TESTED: no colmap on this system")
        models = self.folder / "models"
        models.mkdir()
        result = subprocess.run([colmap, "mapper", "--database_path", str(self.database), "--image_path", str(self.folder),
                                 "--output_path", str(models), "--Mapper.ba_refine_focal_length", "0",
                                 "--Mapper.ba_refine_extra_params", "0"], capture_output=True, text=True, timeout=240)
        self.assertEqual(result.returncode, 0, result.stdout + result.stderr)
        self.assert_poses_are_right(models)

    def test_holba_maps_it_with_the_structure_that_it_holds(self):
        models = self.folder / "models"
        report = json.loads(self.succeeds(
            "map", "--database_path", self.database, "--output_path", models, "--Mapper.ba_refine_focal_length", 0,
            "--Bundle.refine_focal_length", 0, "--Bundle.refine_principal_point", 0, "--json"))
        self.assertGreater(report["models"][0]["lines"], 15)
        self.assertGreater(report["models"][0]["groups"], 1)
        self.assert_poses_are_right(models)


if __name__ == "__main__":
    unittest.main()
