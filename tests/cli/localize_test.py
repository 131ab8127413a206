#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""`holba localize` as a user meets it. Environment: as cli_test.py."""

import hashlib
import json
import pathlib
import sqlite3
import struct
import unittest
from random import Random

from cli_test import Case

WIDTH, HEIGHT, FOCAL, DEPTH = 240, 180, 220.0, 2.0
# Photographs of a wall at z = DEPTH from places along x; a metre is FOCAL / DEPTH pixels.
SHIFTS_PX = {"a.pgm": 0, "b.pgm": 22, "c.pgm": 44, "new.pgm": 33}


class Localize(Case):
    """New photographs of a wall in a model of others of it."""

    def setUp(self):
        super().setUp()
        self.photographs = self.folder / "photographs"
        self.photographs.mkdir()
        random = Random(7)
        wide = WIDTH + 60
        wall = [[100] * wide for _ in range(HEIGHT)]
        for _ in range(160):
            x, y, w, h = random.randrange(wide), random.randrange(HEIGHT), random.randrange(4, 24), random.randrange(4, 24)
            grey = random.randrange(20, 235)
            for row in range(y, min(y + h, HEIGHT)):
                for column in range(x, min(x + w, wide)):
                    wall[row][column] = grey
        for name, shift in SHIFTS_PX.items():
            pixels = b"".join(bytes(row[shift:shift + WIDTH]) for row in wall)
            (self.photographs / name).write_bytes(f"P5 {WIDTH} {HEIGHT} 255\n".encode() + pixels)

    def make_model(self) -> tuple[pathlib.Path, pathlib.Path]:
        """Database and model (text) of a, b and c: points of the wall that all three have a keypoint of."""
        names = self.folder / "names.txt"
        names.write_text("a.pgm\nb.pgm\nc.pgm\n")
        database = self.folder / "database.db"
        self.succeeds("extract", "--image_path", self.photographs, "--database_path", database, "--image_list_path", names,
                      "--ImageReader.camera_model", "SIMPLE_PINHOLE", "--ImageReader.single_camera", "1",
                      "--ImageReader.camera_params", f"{FOCAL},{WIDTH / 2},{HEIGHT / 2}")
        keypoints = {}
        connection = sqlite3.connect(database)
        for name, rows, cols, data in connection.execute(
                "SELECT name, rows, cols, data FROM images JOIN keypoints USING (image_id)"):
            values = struct.unpack(f"<{rows * cols}f", data)
            keypoints[name] = [values[cols * i:cols * i + 2] for i in range(rows)]
        ids = dict(connection.execute("SELECT name, image_id FROM images"))
        connection.close()
        points, owner = [], {name: [-1] * len(keypoints[name]) for name in keypoints}
        for i, (x, y) in enumerate(keypoints["a.pgm"]):
            track = [("a.pgm", i)]
            for name in ("b.pgm", "c.pgm"):
                for k, (u, v) in enumerate(keypoints[name]):
                    if owner[name][k] < 0 and abs(u + SHIFTS_PX[name] - x) < 0.3 and abs(v - y) < 0.3:
                        track.append((name, k))
                        break
            if len(track) < 3:
                continue
            points.append((len(points) + 1, x, y, track))
            for name, k in track:
                owner[name][k] = len(points)
        self.assertGreater(len(points), 40)
        model = self.folder / "of_wall"
        model.mkdir()
        (model / "cameras.txt").write_text(f"1 SIMPLE_PINHOLE {WIDTH} {HEIGHT} {FOCAL} {WIDTH / 2} {HEIGHT / 2}\n")
        lines = []
        for name in keypoints:
            lines.append(f"{ids[name]} 1 0 0 0 {-SHIFTS_PX[name] * DEPTH / FOCAL} 0 0 1 {name}")
            lines.append(" ".join(f"{x} {y} {owner[name][k]}" for k, (x, y) in enumerate(keypoints[name])))
        (model / "images.txt").write_text("\n".join(lines) + "\n")
        lines = []
        for point, x, y, track in points:
            X, Y = (x - WIDTH / 2) * DEPTH / FOCAL, (y - HEIGHT / 2) * DEPTH / FOCAL
            elements = " ".join(f"{ids[name]} {k}" for name, k in track)
            lines.append(f"{point} {X} {Y} {DEPTH} 9 9 9 0.1 {elements}")
        (model / "points3D.txt").write_text("\n".join(lines) + "\n")
        return database, model

    def test_a_new_photograph_gets_the_pose_it_was_taken_from(self):
        database, model = self.make_model()
        before = hashlib.sha256(database.read_bytes()).hexdigest()
        output = self.folder / "output"
        for words in (("--database_path", database), ()):  # found anew without a database
            told = json.loads(self.succeeds("localize", "--image_path", self.photographs, "--input_path", model,
                                            "--output_path", output, "--ImageReader.camera_model", "SIMPLE_PINHOLE",
                                            "--ImageReader.camera_params", f"{FOCAL},{WIDTH / 2},{HEIGHT / 2}",
                                            "--json", *words))
            self.assertEqual(told["localized"], 1)
            (image,) = told["images"]
            self.assertEqual(image["name"], "new.pgm")
            expected = [SHIFTS_PX["new.pgm"] * DEPTH / FOCAL, 0.0, 0.0]
            for value, wanted in zip(image["centre"], expected):
                self.assertAlmostEqual(value, wanted, delta=0.02)
            self.assertLess(image["centre_sigma"], 0.02)
            self.assertEqual(len(image["covariance"]), 6)
            self.assertEqual(json.loads((output / "localization.json").read_text())["images"], told["images"])
            listing = {path.name for path in output.iterdir()}
            self.assertIn("images.bin", listing)
            self.assertFalse([name for name in listing if name.endswith(".db")])
            errors = json.loads(self.succeeds("evaluate", "--input_path", output, "--json"))
            self.assertTrue(errors)
        self.assertEqual(hashlib.sha256(database.read_bytes()).hexdigest(), before)

    def test_a_photograph_of_something_else_has_a_reason(self):
        database, model = self.make_model()
        random = Random(8)
        noise = bytes(random.randrange(256) for _ in range(WIDTH * HEIGHT))
        (self.photographs / "other.pgm").write_bytes(f"P5 {WIDTH} {HEIGHT} 255\n".encode() + noise)
        (self.photographs / "grey.pgm").write_bytes(f"P5 {WIDTH} {HEIGHT} 255\n".encode() + bytes(WIDTH * HEIGHT))
        names = self.folder / "new.txt"
        names.write_text("other.pgm\ngrey.pgm\na.pgm\n")
        told = json.loads(self.succeeds("localize", "--database_path", database, "--image_path", self.photographs,
                                        "--image_list_path", names, "--input_path", model, "--output_path",
                                        self.folder / "output", "--json"))
        self.assertEqual(told["localized"], 0)
        reasons = {image["name"]: image["reason"] for image in told["images"]}
        self.assertIn("the model has an image of this name", reasons["a.pgm"])
        self.assertIn("no features", reasons["grey.pgm"])
        self.assertTrue(reasons["other.pgm"])

    def test_names_what_is_missing(self):
        output = self.folder / "output"
        database, model = self.make_model()
        words = ["localize", "--output_path", output, "--input_path"]
        self.assertIn("--image_path", self.refuses(*words, model))
        self.assertIn("holba extract", self.refuses(*words, model, "--database_path", self.folder / "no.db"))
        self.assertIn("--image_path", self.refuses(*words, model, "--image_path", self.folder / "nowhere"))
        self.refuses(*words, self.folder / "nowhere", "--image_path", self.photographs)
        # The database has the model's images only.
        self.assertIn("no image that the model lacks", self.refuses(*words, model, "--database_path", database))
        self.assertFalse(output.exists())


if __name__ == "__main__":
    unittest.main()
