#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""`holba import` as a user meets it (what each adapter reads is tested beside its source). Environment: HOLBA, path of
the program."""

import json
import os
import pathlib
import struct
import subprocess
import sys
import tempfile
import unittest
import zlib

HOLBA = os.environ["HOLBA"]


def holba(*words) -> subprocess.CompletedProcess:
    return subprocess.run([HOLBA, *map(str, words)], capture_output=True, text=True, timeout=120)


def write_png(path: pathlib.Path, width: int, height: int) -> None:
    def chunk(kind: bytes, body: bytes) -> bytes:
        return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))

    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)) +
                     chunk(b"IDAT", zlib.compress((b"\0" + b"\x80" * width) * height)) + chunk(b"IEND", b""))


class Import(unittest.TestCase):
    def setUp(self):
        self._temporary = tempfile.TemporaryDirectory()
        self.addCleanup(self._temporary.cleanup)
        self.folder = pathlib.Path(self._temporary.name)
        self.tum = self.folder / "rgbd_dataset_freiburg3_office"
        for i in range(4):
            write_png(self.tum / "rgb" / f"{i}.5.png", 640, 480)
        (self.tum / "rgb.txt").write_text("".join(f"{i}.5 rgb/{i}.5.png\n" for i in range(4)))
        (self.tum / "groundtruth.txt").write_text("".join(f"{i}.5 {i} 0 {i % 2} 0 0 0 1\n" for i in range(3)))

    def succeeds(self, *words) -> str:
        result = holba(*words)
        self.assertEqual(result.returncode, 0, result.stderr)
        return result.stdout

    def refuses(self, *words) -> str:
        result = holba(*words)
        self.assertEqual((result.returncode, result.stdout), (1, ""), result.stderr)
        self.assertEqual(result.stderr.count("\n"), 1, result.stderr)
        self.assertNotIn("internal error", result.stderr)
        return result.stderr

    def test_photographs_are_linked_and_said_to_be_there(self):
        target = self.folder / "set"
        told = json.loads(self.succeeds("import", "--dataset", "tum rgb-d", "--input_path", self.tum, "--output_path",
                                        target, "--json"))
        self.assertEqual(told, json.loads((target / "dataset.json").read_text()))
        self.assertEqual((told["dataset"], told["unit"], told["part"]), ("TUM RGB-D", "metres", "freiburg3"))
        self.assertEqual((told["images"]["count"], told["truth"]["with_pose"], told["mesh"]), (4, 3, None))
        links = sorted((target / "images").iterdir())
        self.assertEqual([link.name for link in links], [f"{i}.5.png" for i in range(4)])
        for link in links:
            self.assertTrue(link.is_symlink())
            self.assertEqual(link.resolve(), (self.tum / "rgb" / link.name).resolve())
        # Other commands read what was written.
        found = json.loads(self.succeeds("evaluate_poses", "--input_path", target / "gt", "--ground_truth_path",
                                         target / "gt", "--json"))
        self.assertEqual((found["registered"], found["auc"]["1"]), (3, 100.0))

    def test_photographs_are_copied_and_an_earlier_import_is_replaced(self):
        target = self.folder / "set"
        words = ("import", "--dataset", "tum_rgbd", "--input_path", self.tum, "--output_path", target)
        self.succeeds(*words)
        (target / "my notes.txt").write_text("mine")
        self.succeeds(*words, "--image_mode", "copy", "--stride", 2, "--output_type", "bin")
        self.assertEqual(sorted(path.name for path in (target / "images").iterdir()), ["0.5.png", "2.5.png"])
        self.assertFalse((target / "images" / "0.5.png").is_symlink())
        self.assertEqual((target / "images" / "0.5.png").read_bytes(), (self.tum / "rgb" / "0.5.png").read_bytes())
        self.assertEqual((target / "my notes.txt").read_text(), "mine")
        self.assertTrue((target / "gt" / "images.bin").exists())
        self.assertFalse((target / "gt" / "images.txt").exists())

    def test_what_is_wrong_is_named_and_nothing_is_written(self):
        target = self.folder / "set"
        words = ("--input_path", self.tum, "--output_path", target)
        self.assertIn("expected one of ETH3D, Hypersim", self.refuses("import", "--dataset", "KITTI", *words))
        self.assertIn("list.txt", self.refuses("import", "--dataset", "1DSfM", *words))
        self.assertIn("nowhere: there is no such folder; check --input_path",
                      self.refuses("import", "--dataset", "EuRoC", "--input_path", self.folder / "nowhere", "--output_path", target))
        (self.tum / "rgb" / "2.5.png").write_bytes(b"no photograph")
        (self.tum / "rgb" / "0.5.png").write_bytes(b"no photograph")
        self.assertIn("0.5.png", self.refuses("import", "--dataset", "TUM RGB-D", *words))
        self.assertEqual(sorted(path.name for path in self.folder.iterdir()), [self.tum.name])


if __name__ == "__main__":
    unittest.main(argv=sys.argv)
