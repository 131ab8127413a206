#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""`holba render` of a preset as a user meets it. Environment: as cli_test.py."""

import json
import struct
import subprocess
import unittest

from cli_test import HOLBA, Case

SMALL = ("--Camera.width", "160", "--Camera.height", "120", "--Walk.num_images", "3", "--Photo.samples", "1")


class Render(Case):
    def test_a_preset_has_photographs_maps_a_mesh_and_a_truth_without_residuals(self):
        output = self.folder / "table"
        subprocess.run([HOLBA, "render", "--preset", "table", "--output_path", output, "--quiet",
                        "--Camera.model", "SIMPLE_RADIAL", "--Camera.extra_params", "-0.05", *SMALL], check=True)
        stems = [f"table_{i:04}" for i in (1, 2, 3)]
        self.assertEqual(sorted(p.name for p in (output / "images").iterdir()), [s + ".jpg" for s in stems])
        for stem in stems:
            depth = (output / "depth" / (stem + ".npy")).read_bytes()
            header = struct.unpack("<H", depth[8:10])[0]
            self.assertIn(b"(120, 160)", depth[:10 + header])
            self.assertEqual(len(depth), 10 + header + 4 * 120 * 160)
            self.assertEqual((output / "labels" / (stem + ".png")).read_bytes()[24], 16)  # bits
            self.assertTrue((output / "normals" / (stem + ".npy")).is_file())
        types = json.loads((output / "labels" / "labels.json").read_text())["labels"]
        self.assertEqual(set(types.values()), {"plane", "sphere", "cylinder", "cone", "ellipsoid", "cuboid"})
        # The mesh names as many vertices and faces as it has.
        mesh = (output / "mesh.ply").read_bytes()
        head, body = mesh.split(b"end_header\n", 1)
        counts = [int(line.split()[2]) for line in head.decode().splitlines() if line.startswith("element")]
        self.assertEqual(len(body), counts[0] * (24 + 3 + 4) + counts[1] * 13)
        # Labels are the numbers of groups of the same type.
        for line in (output / "truth" / "groups3D.txt").read_text().splitlines():
            words = line.split()
            if not line.startswith("#") and words[1] != "VP":
                self.assertEqual(types[words[0]].upper(), words[1])
        result = subprocess.run([HOLBA, "evaluate", "--input_path", output / "truth", "--json", "--quiet"],
                                check=True, capture_output=True, text=True)
        terms = json.loads(result.stdout)["terms"]
        for name in ("point", "line", "group_point", "group_line", "vp", "relation"):
            self.assertGreater(terms[name]["residuals"], 0, name)
        for name, term in terms.items():
            self.assertLess(term["sum_squares"], 1e-8, name)

    def test_an_unknown_preset_is_refused_with_the_list(self):
        result = subprocess.run([HOLBA, "render", "--preset", "rom_1", "--output_path", self.folder / "x"],
                                capture_output=True, text=True)
        self.assertEqual(result.returncode, 1)
        self.assertIn("room_1", result.stderr)
        self.assertFalse((self.folder / "x").exists())


if __name__ == "__main__":
    unittest.main()
