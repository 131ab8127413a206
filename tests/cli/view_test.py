#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""`holba view --picture_path`, and what commands show of their progress. Environment: as cli_test.py."""

import os
import pathlib
import pty
import re
import struct
import subprocess
import unittest
import zlib

from cli_test import Case


def png_size(path: pathlib.Path) -> tuple[int, int]:
    data = path.read_bytes()
    assert data[:8] == b"\x89PNG\r\n\x1a\n", path
    return struct.unpack(">II", data[16:24])


def png_pixels(path: pathlib.Path) -> bytes:
    """All bytes of the rows, filtered as they are stored: the same of the same picture."""
    data, at, packed = path.read_bytes(), 8, b""
    while at < len(data):
        length, kind = struct.unpack(">I4s", data[at:at + 8])
        if kind == b"IDAT":
            packed += data[at + 8:at + 8 + length]
        at += 12 + length
    return zlib.decompress(packed)


class Pictures(Case):
    """Pictures of a model without a browser."""

    def setUp(self):
        super().setUp()
        self.pictures = self.folder / "pictures"

    def names(self) -> set[str]:
        return {str(path.relative_to(self.pictures)) for path in self.pictures.rglob("*") if path.is_file()}

    def test_views_of_the_scene_are_png_of_one_longer_side(self):
        self.succeeds("view", "--input_path", self.model, "--picture_path", self.pictures)
        self.assertEqual(self.names(), {"overview.png", "plan.png", "front.png", "side.png"})
        for name in self.names():
            self.assertEqual(png_size(self.pictures / name)[0] if name == "overview.png" else 1600, 1600)
        # The folder holds no page, and none was opened.
        self.assertEqual(list(self.folder.glob("**/*.html")), [])

    def test_photographs_are_drawn_upon_and_other_files_stay(self):
        images = self.folder / "images"
        images.mkdir()
        (images / "first.jpg").write_bytes(b"P6 640 480 255\n" + bytes([90, 120, 150]) * (640 * 480))
        self.pictures.mkdir()
        (self.pictures / "notes.txt").write_text("mine")
        for _ in range(2):
            self.succeeds("view", "--input_path", self.model, "--image_path", images, "--picture_path", self.pictures,
                          "--num_pictures", "-1")
        drawn = {f"view_images/first_{what}.png" for what in ("model", "lines", "groups", "wireframe")}
        self.assertEqual(self.names(), drawn | {"overview.png", "plan.png", "front.png", "side.png", "notes.txt"})

    def test_the_same_model_gives_the_same_pictures_for_any_number_of_threads(self):
        seen = []
        for threads in (1, 3):
            self.succeeds("view", "--input_path", self.model, "--picture_path", self.pictures, "--num_threads", threads)
            seen.append([png_pixels(self.pictures / name) for name in sorted(self.names())])
        self.assertEqual(seen[0], seen[1])

    def test_a_page_is_written_beside_them_where_it_is_asked_for(self):
        page = self.folder / "page.html"
        self.succeeds("view", "--input_path", self.model, "--picture_path", self.pictures, "--output_path", page)
        self.assertTrue(page.is_file())
        self.assertIn("plan.png", self.names())


class ProgressBars(Case):
    """Bars with the time left, on a terminal only."""

    def setUp(self):
        super().setUp()
        self.images = self.folder / "images"
        self.images.mkdir()
        for k in range(3):
            rows = bytes((x // 16 + y // 16 + k) % 2 * 200 + 20 for y in range(120) for x in range(160))
            (self.images / f"{k}.pgm").write_bytes(b"P5 160 120 255\n" + rows)

    def words(self, name: str) -> list[str]:
        return [os.environ["HOLBA"], "extract", "--image_path", str(self.images), "--database_path", str(self.folder / name)]

    def on_a_terminal(self, words: list[str]) -> str:
        """What stderr gets where it is a terminal."""
        main, terminal = pty.openpty()
        process = subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=terminal)
        os.close(terminal)
        seen = b""
        while True:
            try:
                part = os.read(main, 65536)
            except OSError:  # Linux: the other end is closed
                break
            if not part:
                break
            seen += part
        os.close(main)
        self.assertEqual(process.wait(), 0, seen)
        return seen.decode()

    def test_a_terminal_shows_a_bar_and_nothing_of_it_stays(self):
        seen = self.on_a_terminal(self.words("terminal.db"))
        self.assertRegex(seen, r"\rExtracting \[#*-*\] \d+ / 3 images")
        self.assertIn("Extracting [" + 24 * "#" + "] 3 / 3 images", seen)
        # The last of it is that the line is removed.
        self.assertLess(seen.rfind("Extracting"), seen.rfind("\r\x1b[K"))
        # A message begins on a line of its own.
        for message in re.findall(r"[^\r\n]*(?:info|warning) ", seen):
            self.assertNotIn("Extracting", message)

    def test_quiet_shows_none(self):
        self.assertEqual(self.on_a_terminal([*self.words("quiet.db"), "--quiet"]), "")

    def test_a_pipe_has_nothing_of_it(self):
        done = subprocess.run(self.words("pipe.db"), capture_output=True, check=True)
        self.assertNotIn(b"\r", done.stderr)
        self.assertNotIn(b"\x1b", done.stderr)
        self.assertNotIn(b"Extracting [", done.stderr)


if __name__ == "__main__":
    unittest.main()
