#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""The holba program on models that others wrote or changed. Environment: HOLBA, path of the program; HOLBA_DATA_DIR,
folder of the inputs (models_other, reports), without which the tests are skipped."""

import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
import unittest

HOLBA = os.environ["HOLBA"]
DATA = pathlib.Path(os.environ.get("HOLBA_DATA_DIR", ""))


def holba(*words, **kwargs) -> subprocess.CompletedProcess:
    return subprocess.run([HOLBA, *map(str, words)], capture_output=True, text=True, errors="replace", timeout=300,
                          **kwargs)


class Case(unittest.TestCase):
    def setUp(self):
        if not (DATA / "models_other").is_dir() or not (DATA / "reports").is_dir():
            self.skipTest(f"SKIPPED, NOT TESTED: no models_other and reports in {DATA} (set HOLBA_DATA_DIR)")
        temporary = tempfile.TemporaryDirectory()
        self.addCleanup(temporary.cleanup)
        self.folder = pathlib.Path(temporary.name)

    def refuses(self, *words) -> str:
        """What a run says that must fail for what its user did, and write nothing."""
        output = self.folder / "refused"
        words = [output if word == "OUT" else word for word in words]
        result = holba(*words)
        self.assertEqual(result.returncode, 1, (words, result.stdout, result.stderr))
        self.assertEqual(result.stdout, "")
        self.assertNotIn("internal error", result.stderr)
        self.assertFalse(output.exists())
        return result.stderr

    def succeeds(self, *words) -> subprocess.CompletedProcess:
        result = holba(*words)
        self.assertEqual(result.returncode, 0, (words, result.stderr))
        return result


class ModelsOfOthers(Case):
    # What COLMAP refuses as well, and why.
    REFUSED = {"foreign": "expected a COLMAP model", "robocam_noPoints_txt": "expected a COLMAP model"}
    # Two images without any point, one with a quaternion that is far from a rotation: nothing to adjust.
    EMPTY = {"issue1902_txt"}

    def test_each_is_adjusted_or_refused_for_a_reason_that_colmap_shares(self):
        models = sorted(path for path in (DATA / "models_other").iterdir() if path.is_dir())
        self.assertGreaterEqual(len(models), 13)
        for model in models:
            with self.subTest(model=model.name):
                output = self.folder / model.name
                result = holba("adjust", "--input_path", model, "--output_path", output,
                               "--Bundle.config", "point", "--log_level", "warning")
                if model.name in self.REFUSED:
                    self.assertEqual(result.returncode, 1)
                    self.assertIn(self.REFUSED[model.name], result.stderr)
                    self.assertEqual(result.stderr.count("\n"), 1, result.stderr)
                elif model.name in self.EMPTY:
                    self.assertIn(result.returncode, (0, 1))
                    self.assertNotIn("internal error", result.stderr)
                else:
                    self.assertEqual(result.returncode, 0, result.stderr)
                    self.assertTrue((output / "points3D.bin").exists())

    def test_tracks_with_wrong_indices_are_corrected(self):
        # Every index of every track is 0; the images name their points.
        model = DATA / "models_other" / "gtsfm_lund_C11_txt"
        output = self.folder / "out"
        result = self.succeeds("convert", "--input_path", model, "--output_path", output, "--output_type", "txt")
        self.assertIn("of 5163 links", result.stderr)
        self.assertIn("0 were left out and 5160 corrected", result.stderr)
        tracks = {}
        for line in (output / "points3D.txt").read_text().splitlines():
            if not line.startswith("#"):
                words = line.split()
                tracks[words[0]] = words[8:]
        self.assertEqual(len(tracks), 1721)
        self.assertEqual(tracks["17"], "0 17 1 17 2 17".split())


class OneSidedTracks(Case):
    # Links that are left, and what of them is one-sided.
    MODELS = {"image_names_deleted_point": (588, 8, "2D features that name a missing 3D feature: 8"),
              "point_not_in_track": (588, 1, "2D features that name a 3D feature that does not name them: 1"),
              "track_names_deleted_image": (588, 59, "3D features that name a missing image: 59"),
              "track_names_free_point": (588, 1, "3D features that name a 2D feature that does not name them: 1")}

    def test_they_are_left_out_with_one_warning_and_the_rest_is_used(self):
        for name, (links, dropped, reason) in self.MODELS.items():
            with self.subTest(model=name):
                model, output = DATA / "reports" / "one-sided-tracks" / name, self.folder / name
                result = self.succeeds("convert", "--input_path", model, "--output_path", output,
                                       "--output_type", "txt", "--log_level", "warning")
                self.assertEqual(result.stderr.count("\n"), 1, result.stderr)
                self.assertIn(str(model), result.stderr)
                self.assertIn(f"of {links} links between features of images and 3D features {dropped} were left out",
                              result.stderr)
                self.assertIn(f"({reason})", result.stderr)
                # What is written has both ends of each link.
                again = self.succeeds("convert", "--input_path", output, "--output_path", self.folder / "again",
                                      "--strict", "1", "--log_level", "warning")
                self.assertEqual(again.stderr, "")
                summary = self.succeeds("adjust", "--input_path", model, "--output_path", self.folder / "adjusted",
                                        "--quiet").stdout
                self.assertRegex(summary, rf"\npoint +{links - dropped} +0 ")

    def test_strict_refuses_with_the_whole_list(self):
        for name, (_, dropped, reason) in self.MODELS.items():
            with self.subTest(model=name):
                model = DATA / "reports" / "one-sided-tracks" / name
                message = self.refuses("adjust", "--input_path", model, "--output_path", "OUT", "--strict", "1")
                self.assertIn(f"({reason})", message)
                self.assertEqual(message.count("\n  "), dropped)

    def test_evaluate_and_transform_take_them_as_well(self):
        model = DATA / "reports" / "one-sided-tracks" / "track_names_deleted_image"
        self.succeeds("evaluate", "--input_path", model)
        self.succeeds("transform", "--input_path", model, "--output_path", self.folder / "moved", "--scale", "2")
        self.assertIn("image 10", self.refuses("transform", "--input_path", model, "--output_path", "OUT",
                                               "--strict", "1"))
        self.assertIn("image 10", self.refuses("evaluate", "--input_path", model, "--strict", "1"))


class DuplicateNames(Case):
    def test_every_command_names_both_images_and_the_name(self):
        case = DATA / "reports" / "refine-duplicate-name"
        model, sound = case / "model", DATA / "reports" / "pose-names" / "jpg"
        commands = [("convert", "--output_path", "OUT"), ("adjust", "--output_path", "OUT"), ("evaluate",),
                    ("transform", "--output_path", "OUT"), ("evaluate_poses", "--ground_truth_path", sound)]
        if "refine" in holba("help").stdout:
            commands.append(("refine", "--image_path", case / "images", "--output_path", "OUT"))
        for name, *words in commands:
            with self.subTest(command=name):
                message = self.refuses(name, "--input_path", model, *words)
                self.assertIn("images 1 and 2 have the same name '0000.jpg'", message)
                self.assertIn(str(model), message)
                self.assertEqual(message.count("\n"), 1)
        for name in ("evaluate", "evaluate_poses"):
            self.assertIn("images 1 and 2", self.refuses(name, "--input_path", sound, "--ground_truth_path", model))


if __name__ == "__main__":
    result = unittest.main(exit=False, verbosity=2).result
    # 77: all of it was skipped.
    sys.exit(1 if not result.wasSuccessful() else 77 if len(result.skipped) == result.testsRun else 0)
