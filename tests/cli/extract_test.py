#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""`holba extract` and `holba inspect` as a user meets them. Environment: as cli_test.py."""

import json
import pathlib
import subprocess
import time
import unittest
from random import Random

from cli_test import HOLBA, Case


class Extract(Case):
    """Photographs into a database, killed at any moment."""

    def setUp(self):
        super().setUp()
        self.photographs = self.folder / "photographs"
        (self.photographs / "sub").mkdir(parents=True)
        random = Random(4)
        for name in ("a.ppm", "b.pgm", "sub/c.pgm"):
            grey = bytearray(bytes([90]) * (120 * 90))
            for _ in range(40):
                x, y, w, h = (random.randrange(10, n) for n in (100, 70, 30, 25))
                for row in range(y, min(y + h, 90)):
                    for column in range(x, min(x + w, 120)):
                        grey[120 * row + column] = (grey[120 * row + column] + 37) % 251
            kind, channels = ("P6", 3) if name.endswith("ppm") else ("P5", 1)
            pixels = b"".join(bytes([value]) * channels for value in grey)
            (self.photographs / name).write_bytes(f"{kind} 120 90 255\n".encode() + pixels)

    def extract(self, database: pathlib.Path, *words) -> list:
        return ["extract", "--image_path", self.photographs, "--database_path", database, *words]

    def test_reports_what_inspect_finds(self):
        database = self.folder / "new" / "database.db"
        report = json.loads(self.succeeds(*self.extract(database, "--json")))
        self.assertEqual([i["name"] for i in report["images"]], ["a.ppm", "b.pgm", "sub/c.pgm"])
        self.assertEqual({i["status"] for i in report["images"]}, {"extracted"})
        found = json.loads(self.succeeds("inspect", "--database_path", database, "--json"))
        for key in ("points", "segments", "corners", "vanishing_points", "camera_id"):
            self.assertEqual([i[key] for i in report["images"]], [i[key] for i in found["images"]])
        self.assertGreater(report["points"], 30)
        self.assertEqual(found["cameras"][0]["params"], [1.2 * 120, 60, 45, 0])
        again = json.loads(self.succeeds(*self.extract(database, "--json")))
        self.assertEqual(again["kept"], 3)
        self.assertIn("3 images, 3 cameras", self.succeeds("inspect", "--database_path", database))

    def test_inspect_draws_two_images_side_by_side(self):
        database = self.folder / "database.db"
        self.succeeds(*self.extract(database))
        self.succeeds("match", "--database_path", database)
        picture = self.folder / "pictures" / "a.png"
        ask = ["inspect", "--database_path", database, "--image_names", "a.ppm,sub/c.pgm"]
        self.succeeds(*ask, "--image_path", self.photographs, "--picture_path", picture)
        data = picture.read_bytes()
        self.assertEqual(data[:8], b"\x89PNG\r\n\x1a\n")
        self.assertEqual(int.from_bytes(data[16:20], "big"), 2 * 120 + 6)
        self.assertIn("give both or neither", self.refuses(*ask))
        self.assertIn("must end in .png", self.refuses(*ask, "--picture_path", self.folder / "a.gif"))
        ask[-1] = "a.ppm,d.pgm"
        self.assertIn("no image 'd.pgm'; see", self.refuses(*ask, "--picture_path", picture))
        self.assertEqual(picture.read_bytes(), data)

    def test_what_is_refused_leaves_no_database(self):
        database = self.folder / "refused.db"
        elsewhere = ("--Import.points_path", self.folder / "no")
        self.assertIn("check --Import.points_path", self.refuses(*self.extract(database, *elsewhere)))
        self.assertFalse(database.exists())

    def test_names_what_is_missing(self):
        self.assertIn("no such file", self.refuses("inspect", "--database_path", self.folder / "no"))
        self.assertIn("make it with 'holba extract'",
                      self.refuses("match", "--database_path", self.folder / "no"))
        for command in ("inspect", "match"):
            self.assertIn("expected a file", self.refuses(command, "--database_path", self.folder))
        self.assertFalse((self.folder / "no").exists())
        self.photographs = self.folder / "nowhere"
        self.assertIn("--image_path", self.refuses(*self.extract(self.folder / "a.db")))

    def test_a_killed_run_goes_on(self):
        whole = self.folder / "whole.db"
        self.succeeds(*self.extract(whole))
        expected = self.succeeds("inspect", "--database_path", whole)
        for delay in (0.02, 0.05, 0.1, 0.2):
            database = self.folder / f"killed{delay}.db"
            process = subprocess.Popen([HOLBA, *map(str, self.extract(database))],
                                       stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
            time.sleep(delay)
            process.kill()
            process.wait()
            self.succeeds(*self.extract(database))
            self.assertEqual(self.succeeds("inspect", "--database_path", database), expected)


if __name__ == "__main__":
    unittest.main()
