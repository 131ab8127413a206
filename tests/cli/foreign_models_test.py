#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""The holba program on models that others wrote or changed. Environment: HOLBA, path of the program; HOLBA_DATA_DIR,
folder of the inputs (models_other, reports), without which the tests are skipped."""

import json
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
    REFUSED = {"foreign": "expected a COLMAP model", "robocam_noPoints_txt": "found cameras.txt and images.txt without points3D.txt; triangulate points"}
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
        self.assertIn("left out 0 and corrected 5160 of 5163 links", result.stderr)
        tracks = {}
        for line in (output / "points3D.txt").read_text().splitlines():
            if not line.startswith("#"):
                words = line.split()
                tracks[words[0]] = words[8:]
        self.assertEqual(len(tracks), 1721)
        self.assertEqual(tracks["17"], "0 17 1 17 2 17".split())


class OtherPrograms(Case):
    # Images with a pose, without one, points.
    SAMPLES = {"balbianello_bundler.out": (5, 0, 544), "kermit_bundler.out": (9, 2, 634),
               "platypus_bundler.out": (6, 0, 3217), "meshroom_cameras.sfm": (34, 17, 0),
               "metashape_cameras.xml": (94, 0, 0), "openmvg_sfm_data.json": (0, 10, 0),
               "opensfm_reconstruction.json": (3, 0, 1554)}

    def records(self, path: pathlib.Path) -> list[str]:
        if not path.exists():
            return []
        return [line for line in path.read_text(errors="replace").split("\n") if not line.startswith("#")]

    def test_each_is_read_by_every_command_that_reads_a_model(self):
        for name, (num_posed, num_waiting, num_points) in self.SAMPLES.items():
            with self.subTest(sample=name):
                source, output = DATA / "models_other" / "foreign" / name, self.folder / name
                self.succeeds("convert", "--input_path", source, "--output_path", output, "--output_type", "txt")
                # Two lines an image, and the one behind the last line end.
                self.assertEqual(len(self.records(output / "images.txt")) // 2, num_posed)
                self.assertEqual(len(self.records(output / "unregistered_images.txt")) // 2, num_waiting)
                self.assertEqual(len(self.records(output / "points3D.txt")) - 1, num_points)
                self.succeeds("transform", "--input_path", source, "--output_path", self.folder / "moved", "--scale", "2")
                result = self.succeeds("evaluate", "--input_path", source, "--json", "--quiet")
                residuals = json.loads(result.stdout)["terms"]["point"]["residuals"]
                self.assertEqual(residuals > 0, "bundler" in name)
                # Where a folder holds it alone, the folder is enough.
                folder = self.folder / ("alone_" + name)
                folder.mkdir()
                shutil.copy(source, folder)
                self.succeeds("convert", "--input_path", folder, "--output_path", self.folder / "moved")
                if num_posed < 2:
                    continue
                poses = self.succeeds("evaluate_poses", "--input_path", source, "--ground_truth_path", output, "--json")
                self.assertAlmostEqual(json.loads(poses.stdout)["auc"]["1"], 100.0, places=6)
                # Poses go through nerfstudio unharmed; its cameras need sizes.
                if "bundler" not in name:
                    self.succeeds("convert", "--input_path", source, "--output_path", self.folder / "nerf" / name,
                                  "--output_type", "nerfstudio")
                    poses = self.succeeds("evaluate_poses", "--input_path", self.folder / "nerf" / name,
                                          "--ground_truth_path", source, "--json")
                    self.assertAlmostEqual(json.loads(poses.stdout)["auc"]["1"], 100.0, places=6)

    def test_bundlers_models_are_adjusted_as_they_are(self):
        for name in ("balbianello_bundler.out", "kermit_bundler.out"):
            source, output = DATA / "models_other" / "foreign" / name, self.folder / name
            summary = json.loads(self.succeeds("adjust", "--input_path", source, "--output_path", output, "--json",
                                               "--quiet").stdout)
            self.assertLessEqual(summary["cost"]["final"], summary["cost"]["initial"])
            self.assertTrue((output / "images.bin").exists())

    def test_a_damaged_file_is_named_with_the_place(self):
        source = DATA / "models_other" / "foreign" / "opensfm_reconstruction.json"
        cut = self.folder / "reconstruction.json"
        cut.write_bytes(source.read_bytes()[:300000])
        message = self.refuses("convert", "--input_path", cut, "--output_path", "OUT")
        self.assertIn("reconstruction.json: at byte 3000", message)
        text = source.read_text()
        cut.write_text(text.replace('"translation": [', '"translation": [1, ', 1))
        message = self.refuses("adjust", "--input_path", cut, "--output_path", "OUT")
        self.assertIn("expected a list of 3 numbers at '0/shots/02.jpg/translation', found a list of 4", message)


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
                self.assertIn(f"left out {dropped} of {links} links between features of images and 3D features",
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


class PoseNames(Case):
    def setUp(self):
        super().setUp()
        self.names = DATA / "reports" / "pose-names"

    def test_images_pair_whatever_their_extension_separator_and_folder(self):
        for model, truth, example in (("jpg", "truth_png", "'image000001.png' is 'image000001.jpg'"),
                                      ("backslash", "truth_png", r"'image000001.png' is 'images\image000001.png'"),
                                      ("seq_cam", "truth_cam", "'cam1/000.png' is 'seq/cam1/000.png'")):
            for command in ("evaluate_poses", "evaluate"):
                with self.subTest(model=model, command=command):
                    result = self.succeeds(command, "--input_path", self.names / model, "--ground_truth_path",
                                           self.names / truth)
                    self.assertIn("Paired 0 images by their whole names and 10 by the ends of their paths", result.stderr)
                    self.assertIn(example, result.stderr)
                    if command == "evaluate_poses":
                        self.assertIn("registered   10 of 10 images, 45 of 45 pairs", result.stdout)
                    else:
                        self.assertIn("position_rms", result.stdout)

    def test_names_of_another_set_are_refused_with_one_of_each(self):
        for command in ("evaluate_poses", "evaluate"):
            message = self.refuses(command, "--input_path", self.names / "jpg", "--ground_truth_path",
                                   self.names / "truth_cam")
            self.assertIn("only 0 of the 10 images of the model", message)
            self.assertIn("'image000001.jpg'", message)
            self.assertIn("'cam1/000.png'", message)

    def test_a_truth_needs_poses_only(self):
        poses = self.folder / "poses"
        poses.mkdir()
        shutil.copy(self.names / "truth_png" / "images.txt", poses)
        for command in ("evaluate_poses", "evaluate"):
            of_poses, of_model = (self.succeeds(command, "--input_path", self.names / "jpg", "--ground_truth_path",
                                                truth, "--quiet", *(("--alignment", "centres") if command == "evaluate" else ())
                                                ).stdout for truth in (poses, self.names / "truth_png"))
            camera_lines = [line for line in of_model.splitlines() if not line.startswith("point_")]
            self.assertEqual(of_poses.splitlines(), camera_lines)


class PhotographNames(Case):
    def setUp(self):
        super().setUp()
        if "refine" not in holba("help").stdout:
            self.skipTest("SKIPPED, NOT TESTED: this program has no refine")
        # The model of four images, without the duplicate of a name.
        case = DATA / "reports" / "refine-duplicate-name"
        self.images, self.model = case / "images", self.folder / "model"
        shutil.copytree(case / "model", self.model)
        self.model.chmod(0o755)
        (self.model / "images.txt").chmod(0o644)

    def name_images(self, pattern: str) -> None:
        """Image k (1 to 4, in the order of the file) is named by the pattern with {k - 1}."""
        lines = (self.model / "images.txt").read_text().split("\n")
        records = [i for i, line in enumerate(lines) if not line.startswith("#")][::2]
        for k, i in enumerate(record for record in records if lines[record]):
            lines[i] = " ".join([*lines[i].split(" ")[:9], pattern.format(k)])
        (self.model / "images.txt").write_text("\n".join(lines))

    def test_photographs_are_found_under_names_that_differ(self):
        self.name_images("set\\{:04d}.PNG")
        result = self.succeeds("refine", "--image_path", self.images, "--input_path", self.model, "--output_path",
                               self.folder / "out", "--output_type", "txt", "--num_pictures", "1")
        self.assertIn("Paired 0 photographs by their whole names and 4 by the ends of their paths", result.stderr)
        self.assertIn(r"'set\0000.PNG' is '0000.jpg'", result.stderr)
        # The model keeps its names.
        self.assertIn(r" set\0003.PNG", (self.folder / "out" / "images.txt").read_text())

    def test_photographs_of_another_set_are_refused(self):
        self.name_images("other{}.jpg")
        message = self.refuses("refine", "--image_path", self.images, "--input_path", self.model, "--output_path", "OUT")
        self.assertIn("the folder has '0000.jpg', the model 'other0.jpg'", message)


class Alignment(Case):
    def setUp(self):
        super().setUp()
        self.succeeds("synthesize", "--output_path", self.folder / "scene", "--num_images", "12", "--output_type", "txt",
                      "--quiet")

    def errors(self, model: pathlib.Path, truth: pathlib.Path, *words) -> dict:
        result = self.succeeds("evaluate", "--input_path", model, "--ground_truth_path", truth, "--json", *words)
        return json.loads(result.stdout)["ground_truth"]

    def test_one_far_point_does_not_decide(self):
        scene = self.folder / "scene"
        before = self.errors(scene / "perturbed", scene / "truth")
        for folder, where in (("perturbed", "6000 100 8000"), ("truth", "3000 0 4000")):
            path = scene / folder / "points3D.txt"
            lines = path.read_text().splitlines()
            at = next(i for i, line in enumerate(lines) if not line.startswith("#"))
            words = lines[at].split()
            lines[at] = " ".join([words[0], where, *words[4:]])
            path.write_text("\n".join(lines) + "\n")
        after = self.errors(scene / "perturbed", scene / "truth")
        for name in ("rotation_rms_deg", "position_rms", "point_median"):
            self.assertLess(after[name], 1.05 * before[name], name)
        centres = self.errors(scene / "perturbed", scene / "truth", "--alignment", "centres")
        self.assertLessEqual(centres["position_rms"], 1.0001 * after["position_rms"])

    def test_images_of_other_ids_are_the_same_by_name(self):
        scene = self.folder / "scene"
        before = self.errors(scene / "perturbed", scene / "truth", "--alignment", "centres")
        # Images 1 to 12 become 101 to 112; nothing else.
        other = self.folder / "other"
        shutil.copytree(scene / "truth", other)
        for name in ("holistic.json", "lines2D.txt", "lines3D.txt", "groups2D.txt", "groups3D.txt", "wireframe.txt",
                     "relations.txt"):
            (other / name).unlink(missing_ok=True)
        lines = (other / "images.txt").read_text().split("\n")
        records = [i for i, line in enumerate(lines) if not line.startswith("#")]
        for i in records[::2]:
            words = lines[i].split(" ")
            if words[0]:
                lines[i] = " ".join([str(100 + int(words[0])), *words[1:]])
        (other / "images.txt").write_text("\n".join(lines))
        points = []
        for line in (other / "points3D.txt").read_text().splitlines():
            words = line.split()
            if not line.startswith("#"):
                words[8::2] = [str(100 + int(word)) for word in words[8::2]]
            points.append(" ".join(words))
        (other / "points3D.txt").write_text("\n".join(points) + "\n")
        after = self.errors(scene / "perturbed", other, "--alignment", "centres")
        for name in ("rotation_rms_deg", "position_rms", "point_rms"):
            self.assertAlmostEqual(after[name], before[name], places=9)


if __name__ == "__main__":
    result = unittest.main(exit=False, verbosity=2).result
    # 77: all of it was skipped.
    sys.exit(1 if not result.wasSuccessful() else 77 if len(result.skipped) == result.testsRun else 0)
