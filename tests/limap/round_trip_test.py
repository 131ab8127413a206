#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Our models in LIMAP's own hands: pylimap 2.0.0 reads what `convert --output_type limap` writes, and what it writes
from that is read back here. HOLBA: the program; HOLBA_PYLIMAP: a python3 with pylimap."""

import json
import os
import pathlib
import subprocess
import sys
import tempfile
import unittest

HOLBA = os.environ["HOLBA"]
PYTHON = os.environ.get("HOLBA_PYLIMAP", "")

# Run by that python3: reads a model and a database, says what is there, and writes both anew.
IN_LIMAP = r"""
import json, pathlib, sys
import pycolmap
import limap
scene = limap._limap._scene
source, target, database = map(pathlib.Path, sys.argv[1:])
model = scene.HolisticReconstruction()
model.read(source)
structure = model.structure_recon
said = {"valid": model.check_validity(), "images": len(structure.structures2d)}
said["lines"] = {id: [list(line.start), list(line.end), len(line.track.elements)]
                 for id, line in structure.lines3D.items()}
said["groups"] = {id: [int(group.type), list(group.params), len(group.points), len(group.lines),
                       len(group.track.elements), group.check_params()]
                  for id, group in structure.groups3D.items()}
said["edges"] = structure.wireframe.count_edges()
target.mkdir()
model.write(target)
db = scene.StructureDatabase.open(source / "structure_database.db")
said["structures"] = {id: [s.num_points(), s.num_lines(), s.num_groups()]
                      for id, s in db.read_all_structures2d().items()}
said["matches"] = sum(len(m) for _, m in db.read_all_line_matches())
again = scene.StructureDatabase.open(database)
for id, s in db.read_all_structures2d().items():
    again.write_structure2d(id, s)
for pair, matches in db.read_all_line_matches_blob():
    again.write_line_matches(pair // 2147483647, pair % 2147483647, matches)
db.close()
again.close()
print(json.dumps(said))
"""


def run(*words, ok=True):
    result = subprocess.run([str(word) for word in words], capture_output=True, text=True)
    if (result.returncode == 0) != ok:
        raise AssertionError(f"{words}: exit status {result.returncode}\n{result.stdout}{result.stderr}")
    return result


def records(path: pathlib.Path) -> list[list[str]]:
    return [line.split() for line in path.read_text().splitlines() if line and not line.startswith("#")]


class RoundTrip(unittest.TestCase):
    def setUp(self):
        if not PYTHON:
            self.skipTest("SKIPPED, NOT TESTED: no python3 with pylimap 2.0.0 (set HOLBA_PYLIMAP, or run ./test.sh)")
        temporary = tempfile.TemporaryDirectory()
        self.addCleanup(temporary.cleanup)
        self.folder = pathlib.Path(temporary.name)

    def test_limap_reads_ours_and_we_read_what_it_writes(self):
        run(HOLBA, "synthesize", "--output_path", self.folder / "scene", "--num_images", "12", "--output_type", "txt",
            "--vps", "1", "--primitives", "2", "--quiet")
        truth = self.folder / "scene" / "truth"
        run(HOLBA, "convert", "--input_path", truth, "--output_path", self.folder / "limap", "--output_type", "limap",
            "--quiet")
        said = json.loads(run(PYTHON, "-c", IN_LIMAP, self.folder / "limap", self.folder / "again",
                              self.folder / "again.db").stdout.splitlines()[-1])
        lines, groups = records(truth / "lines3D.txt"), records(truth / "groups3D.txt")
        self.assertTrue(said["valid"])
        self.assertEqual(said["images"], 12)
        self.assertEqual(set(said["lines"]), {words[0] for words in lines})
        for words in lines:
            direction, moment = [float(w) for w in words[1:4]], [float(w) for w in words[4:7]]
            start, end, track = said["lines"][words[0]]
            self.assertEqual(2 * track, len(words) - 17)
            for X in (start, end):  # X x d = m
                for i in range(3):
                    j, k = (i + 1) % 3, (i + 2) % 3
                    self.assertAlmostEqual(X[j] * direction[k] - X[k] * direction[j], moment[i], places=9)
        self.assertEqual(set(said["groups"]), {words[0] for words in groups})
        codes = ["VP", "PLANE", "SPHERE", "CYLINDER", "ELLIPSOID", "CUBOID", "CONE"]
        for words in groups:
            kind, params, num_points, num_lines, track, is_valid = said["groups"][words[0]]
            self.assertEqual(codes[kind], words[1])
            self.assertTrue(is_valid, words[:2])
            at = 3 + int(words[2])
            self.assertEqual(num_points, int(words[at]))
            at += 1 + int(words[at])
            self.assertEqual(num_lines, int(words[at]))
            at += 1 + int(words[at])
            self.assertEqual(track, int(words[at]))
        self.assertEqual({words[1] for words in groups}, set(codes))
        self.assertEqual(said["edges"], len(records(truth / "wireframe.txt")))
        # The database: features of every image, pairs of segments of one line.
        of_image = {words[0]: int(words[1]) for words in records(truth / "lines2D.txt")}
        self.assertEqual({id: counts[1] for id, counts in said["structures"].items() if counts[1]},
                         {id: count for id, count in of_image.items() if count})
        pairs = sum(1 for words in lines for a in words[17::2] for b in words[17::2] if int(a) < int(b))
        self.assertEqual(said["matches"], pairs)

        # Back again.
        run(HOLBA, "convert", "--input_path", self.folder / "again", "--output_path", self.folder / "back",
            "--output_type", "txt", "--strict", "1", "--quiet")
        back = self.folder / "back"
        for name in ("lines2D.txt", "groups2D.txt"):
            self.assertEqual(sorted(records(back / name)), sorted(records(truth / name)), name)
        for name, count in (("lines3D.txt", 7), ("groups3D.txt", 3), ("wireframe.txt", 2)):
            ours, theirs = ({words[0] if count > 2 else tuple(words[:2]): words for words in records(folder / name)}
                            for folder in (truth, back))
            self.assertEqual(set(ours), set(theirs), name)
        for words in records(back / "groups3D.txt"):
            true = next(group for group in groups if group[0] == words[0])
            num_params = int(true[2])
            self.assertEqual(words[3 + num_params:], true[3 + num_params:])
            for a, b in zip(words[3:3 + num_params], true[3:3 + num_params]):
                self.assertAlmostEqual(abs(float(a)), abs(float(b)), places=9)  # q and -q are one rotation
        # An adjustment of what came back is one of the same lines and groups.
        terms = [json.loads(run(HOLBA, "evaluate", "--input_path", folder, "--json", "--quiet").stdout)["terms"]
                 for folder in (truth, back)]
        for term in ("point", "line", "group_point", "vp"):
            self.assertEqual(terms[0][term]["residuals"], terms[1][term]["residuals"], term)
            self.assertAlmostEqual(terms[0][term]["sum_squares"], terms[1][term]["sum_squares"],
                                   delta=1e-6 * (1 + terms[0][term]["sum_squares"]), msg=term)

        # The database that LIMAP wrote goes into COLMAP's, which it belongs to.
        database = self.folder / "database.db"
        run(PYTHON, "-c", "import pycolmap, sys\n"
            "model, db = pycolmap.Reconstruction(sys.argv[1]), pycolmap.Database.open(sys.argv[2])\n"
            "for camera in model.cameras.values(): db.write_camera(camera, use_camera_id=True)\n"
            "for rig in model.rigs.values(): db.write_rig(rig, use_rig_id=True)\n"
            "for frame in model.frames.values(): db.write_frame(frame, use_frame_id=True)\n"
            "for image in model.images.values(): db.write_image(image, use_image_id=True)\n", self.folder / "again",
            database)
        run(HOLBA, "convert", "--input_path", self.folder / "again.db", "--output_path", database, "--output_type",
            "database", "--quiet")
        summary = json.loads(run(HOLBA, "inspect", "--database_path", database, "--json").stdout)
        self.assertEqual(summary["line_matches"], pairs)


if __name__ == "__main__":
    result = unittest.main(exit=False, verbosity=2).result
    sys.exit(1 if not result.wasSuccessful() else 77 if len(result.skipped) == result.testsRun else 0)
