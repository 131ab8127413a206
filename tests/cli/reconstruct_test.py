#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""`holba reconstruct` and `holba map` as a user meets them, on photographs that `holba render` makes. Environment: as
cli_test.py."""

import json
import os
import pathlib
import shutil
import signal
import subprocess
import tempfile
import time
import unittest
from random import Random

from cli_test import HOLBA, Case, tree

ROOM = ("--Room.num_images", 8, "--Room.width", 400, "--Room.height", 300)
# Two rounds of refinement would test refine again.
FAST = ("--Refine.num_rounds", 1)


def models_of(folder: pathlib.Path) -> dict[str, bytes]:
    """All that a run wrote but what holds times, and the database."""
    return {name: content for name, content in tree(folder).items()
            if not name.startswith(("report.", "database.db"))}


class RoomCase(Case):
    @classmethod
    def setUpClass(cls):
        cls.room = pathlib.Path(cls.enterClassContext(tempfile.TemporaryDirectory()))
        subprocess.run([HOLBA, "render", "--output_path", cls.room, "--quiet", *map(str, ROOM)], check=True)

    def setUp(self):
        super().setUp()
        self.images = self.folder / "images"
        self.output = self.folder / "output"

    def take(self, *numbers: int) -> None:
        """Photographs of the room, by number from 1."""
        self.images.mkdir(exist_ok=True)
        for number in numbers:
            name = f"room{number:03}.jpg"
            shutil.copy(self.room / "images" / name, self.images / name)

    def words(self, *words) -> list:
        return ["reconstruct", "--image_path", self.images, "--output_path", self.output, *FAST, *words]

    def reconstruct(self, *words) -> dict:
        return json.loads(self.succeeds(*self.words("--json", *words)))

    def reasons(self, report: dict) -> dict[str, str]:
        return {image["name"]: image["reason"] for image in report["map"]["left_out"]}


class Reconstruct(RoomCase):
    def test_photographs_alone_become_a_model_with_all_that_belongs_to_it(self):
        self.take(*range(1, 9))
        report = self.reconstruct()
        model, = report["map"]["models"]
        self.assertEqual(model["images"], 8)
        self.assertEqual(report["map"]["left_out"], [])
        self.assertGreater(model["points"], 200)
        self.assertGreater(model["lines"], 20)
        self.assertLess(model["mean_error_px"], 1.0)
        written = tree(self.output)
        for name in ("database.db", "report.txt", "report.json", "0/cameras.bin", "0/images.bin", "0/points3D.bin",
                     "0/lines3D.bin", "0/structure.ply", "0/points.ply", "0/pictures/top_view.png"):
            self.assertIn(name, written)
        self.assertEqual(sum(name.endswith("_lines.jpg") for name in written), 4)
        self.assertEqual(json.loads(written["report.json"])["map"]["models"][0]["images"], 8)
        text = written["report.txt"].decode()
        for word in ("Photographs", "Matches", "Models", "room003.jpg"):
            self.assertIn(word, text)
        # The lens is unknown to it, and found.
        auc = json.loads(self.succeeds("evaluate_poses", "--input_path", self.output / "0", "--ground_truth_path",
                                       self.room / "truth", "--json"))
        self.assertGreater(auc["auc"]["3"], 85, auc)
        # A second run starts from the database and ends at the same models.
        first = models_of(self.output)
        again = self.reconstruct()
        self.assertEqual(again["extract"]["kept"], 8)
        self.assertEqual(again["match"]["pairs_reused"], 28)
        self.assertEqual(models_of(self.output), first)

    def test_each_photograph_that_is_left_out_has_its_reason(self):
        self.take(*range(1, 6))
        (self.images / "broken.jpg").write_bytes(b"no photograph")
        size = (400, 300)
        (self.images / "blank.ppm").write_bytes(b"P6 %d %d 255\n" % size + bytes([128]) * (3 * 400 * 300))
        random = Random(1)
        other = bytearray()
        for row in range(0, 300, 10):  # squares of chance
            line = b"".join(bytes([random.randrange(256)]) * 30 for _ in range(40))
            other += line * 10
        (self.images / "other.ppm").write_bytes(b"P6 %d %d 255\n" % size + bytes(other))
        shutil.copy(self.images / "room002.jpg", self.images / "twin.jpg")
        report = self.reconstruct("--Mapper.structure", "none")
        broken, = (i for i in report["extract"]["images"] if i["name"] == "broken.jpg")
        self.assertEqual(broken["status"], "left out")
        self.assertIn("broken.jpg", broken["reason"])
        reasons = self.reasons(report)
        self.assertEqual(set(reasons), {"blank.ppm", "other.ppm"})
        self.assertIn("no key points", reasons["blank.ppm"])
        self.assertIn("verified match", reasons["other.ppm"])
        # The same photograph twice is at one place twice.
        self.assertEqual(report["map"]["models"][0]["images"], 6)
        self.succeeds("convert", "--input_path", self.output / "0", "--output_path", self.folder / "txt",
                      "--output_type", "txt")
        poses = {}
        for line in (self.folder / "txt" / "images.txt").read_text().split("\n"):
            words = line.split()
            if len(words) == 10 and words[9].endswith(("jpg", "ppm")):
                poses[words[9]] = [float(w) for w in words[1:8]]
        for a, b in zip(poses["room002.jpg"], poses["twin.jpg"]):
            self.assertAlmostEqual(a, b, delta=2e-3)

    def test_what_gives_no_model_says_why(self):
        self.take(3)
        message = self.refuses(*self.words("--quiet"))
        self.assertIn("no pair of its 1 image could begin a model (no pair has enough verified matches)", message)
        self.assertEqual(set(tree(self.output)), {"database.db"})
        # No baseline.
        shutil.copy(self.images / "room003.jpg", self.images / "twin.jpg")
        message = self.refuses(*self.words("--quiet"))
        self.assertIn("no pair of its 2 images could begin a model", message)
        # Everything unreadable.
        for path in self.images.iterdir():
            path.write_bytes(b"")
        self.output = self.folder / "other"
        self.assertIn("2 of 2 photographs cannot be used", self.refuses(*self.words("--quiet")))
        self.images = self.folder / "nowhere"
        self.assertIn("--image_path", self.refuses(*self.words()))

    def test_an_option_of_several_stages_has_one_place(self):
        names = [o["name"] for o in json.loads(self.succeeds("reconstruct", "--help", "json"))["options"]]
        self.assertEqual(len(names), len(set(names)))
        for name in ("ImageReader.mask_path", "Import.points_path", "Import.segments_path", "LineMatching.num_matches",
                     "Solver.num_threads", "Mapper.structure", "SiftMatching.max_ratio", "pairs"):
            self.assertIn(name, names)
        for name in ("mask_path", "Extraction.num_threads", "FeatureMatching.num_threads", "Extraction.structure"):
            self.assertNotIn(name, names)
        self.take(1, 2)
        self.assertIn("skip_geometric_verification must be 0",
                      self.refuses(*self.words("--FeatureMatching.skip_geometric_verification", 1)))

    def test_map_does_what_reconstruct_does_from_its_database(self):
        self.take(*range(1, 7))
        self.reconstruct()
        output = self.folder / "mapped"
        self.succeeds("map", "--database_path", self.output / "database.db", "--image_path", self.images,
                      "--output_path", output, *FAST)
        self.assertEqual(models_of(output), models_of(self.output))


class Resume(RoomCase):
    """Stopped at any moment, by a kill or an interrupt, and gone on with: the same models."""

    def test_stopped_runs_leave_whole_models_and_go_on_to_the_same_ones(self):
        self.take(*range(1, 9))
        words = self.words("--snapshot_seconds", 0, "--quiet")
        begin = time.monotonic()
        self.succeeds(*words)
        expected = models_of(self.output)
        seconds = time.monotonic() - begin
        num_kills = int(os.environ.get("HOLBA_NUM_KILLS", 6))
        random = Random(5)
        counts = dict.fromkeys(("stopped", "left a snapshot", "left models"), 0)
        for kill in range(num_kills):
            shutil.rmtree(self.output)
            # From nothing in one of three: the others test the mapper, not extraction.
            if kill % 3:
                self.output.mkdir()
                (self.output / "database.db").write_bytes(self.database)
            process = subprocess.Popen([HOLBA, *map(str, words)], stdout=subprocess.DEVNULL)
            time.sleep(random.uniform(0.1, 1.0) * seconds)
            process.send_signal(signal.SIGKILL if kill % 2 else signal.SIGTERM)
            process.wait(timeout=120)
            counts["stopped"] += process.returncode != 0
            left = models_of(self.output) if self.output.exists() else {}
            self.assertIn(left, ({}, expected), kill)
            counts["left models"] += left == expected
            counts["left a snapshot"] += (self.folder / ".output.holba-snapshot").exists()
            self.succeeds(*words, "--resume", 1)
            self.assertEqual(models_of(self.output), expected, kill)
            self.assertFalse((self.folder / ".output.holba-snapshot").exists())
            if kill == 0:
                self.database = (self.output / "database.db").read_bytes()
                begin = time.monotonic()
                self.succeeds(*words)
                seconds = time.monotonic() - begin
        print(f"reconstruct, {num_kills} runs: {counts}")
        self.assertGreater(counts["stopped"], 0)

    def test_a_snapshot_of_another_run_is_refused_by_name(self):
        self.take(*range(1, 7))
        words = self.words("--snapshot_seconds", 0, "--quiet", "--Mapper.structure", "none")
        snapshot = self.folder / ".output.holba-snapshot"
        for _ in range(50):
            process = subprocess.Popen([HOLBA, *map(str, words)], stdout=subprocess.DEVNULL)
            while process.poll() is None and not snapshot.exists():
                time.sleep(0.002)
            process.kill()
            process.wait()
            if snapshot.exists():
                break
        self.assertTrue(snapshot.exists())
        message = self.refuses(*words, "--resume", 1, "--Mapper.tri_min_angle", 3)
        self.assertIn("--Mapper.tri_min_angle was '1.5' and is '3' now", message)
        self.take(7)
        self.assertIn("other images or matches", self.refuses(*words, "--resume", 1))
        snapshot.write_bytes(snapshot.read_bytes()[:-1])  # a part of one is none
        self.succeeds(*words, "--resume", 1)
        self.assertFalse(snapshot.exists())


class Continue(RoomCase):
    """A finished model and further images of its database."""

    def setUp(self):
        super().setUp()
        self.take(1, 2, 3, 4, 5)
        self.succeeds(*self.words())
        self.before = self.output / "0"
        self.take(6, 7, 8)
        self.database = self.output / "database.db"
        self.succeeds("extract", "--image_path", self.images, "--database_path", self.database, "--quiet")
        self.succeeds("match", "--database_path", self.database, "--quiet")

    def images_of(self, model: pathlib.Path) -> dict[str, str]:
        """Pose of each image, as text."""
        folder = self.folder / "text"
        self.succeeds("convert", "--input_path", model, "--output_path", folder, "--output_type", "txt")
        poses = {}
        for line in (folder / "images.txt").read_text().split("\n"):
            words = line.split()
            if len(words) == 10 and words[9].endswith("jpg"):
                poses[words[9]] = " ".join(words[1:8])
        return poses

    def go_on(self, *words) -> dict:
        return json.loads(self.succeeds("map", "--database_path", self.database, "--input_path", self.before,
                                        "--output_path", self.folder / "more", "--json", *FAST, *words))

    def test_new_images_join_and_held_frames_stay_to_the_last_bit(self):
        before = self.images_of(self.before)
        self.assertEqual(len(before), 5)
        report = self.go_on("--Mapper.fix_existing_frames", 1)
        self.assertEqual(report["continued"]["images"], 5)
        self.assertGreater(report["continued"]["points"], 100)
        self.assertEqual(report["models"][0]["images"], 8)
        after = self.images_of(self.folder / "more" / "0")
        self.assertEqual({name: after[name] for name in before}, before)
        self.assertEqual(len(after), 8)
        # Free ones move a little, and all are right.
        self.go_on()
        for pose in (after, self.images_of(self.folder / "more" / "0")):
            self.assertEqual(len(pose), 8)
        auc = json.loads(self.succeeds("evaluate_poses", "--input_path", self.folder / "more" / "0",
                                       "--ground_truth_path", self.room / "truth", "--json"))
        self.assertGreater(auc["auc"]["3"], 85, auc)

    def test_a_model_of_other_photographs_is_refused(self):
        other = self.folder / "other.db"
        (self.images / "room001.jpg").unlink()
        self.succeeds("extract", "--image_path", self.images, "--database_path", other, "--quiet")
        message = self.refuses("map", "--database_path", other, "--input_path", self.before, "--output_path",
                               self.folder / "more", "--quiet")
        self.assertIn("1 of its 5 images are not in the database (first 'room001.jpg')", message)


if __name__ == "__main__":
    unittest.main()
