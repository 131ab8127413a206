#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""`holba bench` of the paper's tables and figures as a user meets it, tiny ones. Environment: as cli_test.py, and
HOLBA_SOURCE_DIR, the project's folder."""

import json
import math
import os
import pathlib
import statistics
import subprocess
import unittest
import xml.etree.ElementTree

from cli_test import HOLBA, Case

TIMING = ("--num_images", "10,20", "--iterations", "3", "--repetitions", "1")
MAPPING = ("--num_images", "20", "--scene", "collection", "--structures", "none,holistic")
SYNTHETIC = {"scaling": TIMING, "wireframe": TIMING, "density": (), "sfm": MAPPING, "breakdown": MAPPING}
RENDERED = ("geometry", "poses", "ablation", "primitives")


def numbers(values: list) -> list[float]:
    return [value for value in values if value is not None]


class PaperTables(Case):
    def bench(self, benchmark: str, num_seeds: int, *options) -> str:
        """Writes results/NAME.json and .svg; returns what it printed."""
        return subprocess.run([HOLBA, "bench", "--benchmark", benchmark, "--output_path", self.folder / "results",
                               "--size", "small", "--num_seeds", str(num_seeds), "--quiet", *options],
                              check=True, capture_output=True, text=True).stdout

    def tables(self, benchmark: str) -> dict:
        return {t["name"]: t for t in json.loads((self.folder / "results" / f"{benchmark}.json").read_text())["tables"]}

    def check_files(self, benchmark: str, printed: str) -> None:
        """Means, deviations and paired differences are those of the values; the plot is XML; the table was printed."""
        for table in self.tables(benchmark).values():
            first = table["rows"][0]
            for row in table["rows"]:
                self.assertIn("| " + row["name"], printed)
                for measure in table["measures"]:
                    of = row["measures"][measure["name"]]
                    self.assertEqual(len(of["values"]), len(table["cases"]))
                    values = numbers(of["values"])
                    if not values:
                        self.assertNotIn("mean", of)
                        continue
                    self.assertAlmostEqual(of["mean"], statistics.mean(values), delta=1e-9 * (1 + abs(of["mean"])))
                    deviation = statistics.stdev(values) if len(values) > 1 else 0.0
                    self.assertAlmostEqual(of["deviation"], deviation, delta=1e-9 * (1 + deviation))
                    pairs = zip(of["values"], first["measures"][measure["name"]]["values"])
                    differences = [a - b for a, b in pairs if a is not None and b is not None]
                    if row is first or not differences:
                        self.assertNotIn("from_first_row", of)
                        continue
                    found = of["from_first_row"]
                    self.assertAlmostEqual(found["mean"], statistics.mean(differences), delta=1e-9 * (1 + abs(found["mean"])))
                    error = statistics.stdev(differences) / math.sqrt(len(differences)) if len(differences) > 1 else 0.0
                    self.assertAlmostEqual(found["standard_error"], error, delta=1e-9 * (1 + error))
        plot = xml.etree.ElementTree.parse(self.folder / "results" / f"{benchmark}.svg").getroot()
        self.assertTrue(plot.tag.endswith("svg"))
        self.assertGreater(len(plot.findall("{http://www.w3.org/2000/svg}circle")), 2)

    def value(self, benchmark: str, table: str, row: str, measure: str) -> list:
        found = [r for r in self.tables(benchmark)[table]["rows"] if r["name"] == row]
        return found[0]["measures"][measure]["values"]

    def page(self) -> str:
        subprocess.run([HOLBA, "bench", "--benchmark", "report", "--input_path", self.folder / "results",
                        "--output_path", self.folder / "page.md", "--quiet"], check=True)
        return (self.folder / "page.md").read_text()

    def test_every_table_and_figure_has_files_and_a_page(self):
        work = ("--work_path", self.folder / "work")
        for benchmark, options in SYNTHETIC.items():
            self.check_files(benchmark, self.bench(benchmark, 2, *options))
        for benchmark in RENDERED:
            self.check_files(benchmark, self.bench(benchmark, 1, *work))
        # 20 poses less the gauge, 4 planes of 3, no line.
        self.assertEqual(self.value("scaling", "scaling_unknowns", "Holistic, dense", "20 images, unknowns"), [125, 125])
        held = numbers(self.value("geometry", "geometry_points", "groups", "within @10 mm, %"))
        self.assertTrue(all(0 <= share <= 100 for share in held))
        # Without a gauge to fix, accuracy stands once.
        self.assertEqual(self.value("ablation", "ablation", "2D, gauge free", "accuracy @1 cm, %"), [None])
        found = self.value("primitives", "primitives", "SPHERE", "found")[0]
        self.assertLessEqual(found, self.value("primitives", "primitives", "SPHERE", "true")[0])
        # What was rendered is used again, to the same result.
        before = (self.folder / "results" / "geometry.json").read_bytes()
        mesh = next((self.folder / "work").glob("room_1*")) / "mesh.ply"
        rendered_at = mesh.stat().st_mtime_ns
        self.bench("geometry", 1, *work)
        self.assertEqual((self.folder / "results" / "geometry.json").read_bytes(), before)
        self.assertEqual(mesh.stat().st_mtime_ns, rendered_at)
        page = self.page()
        for benchmark in (*SYNTHETIC, *RENDERED):
            self.assertIn(f"holba bench --benchmark {benchmark}\n", page)
            self.assertIn(f"(results/{benchmark}.svg)", page)

    def test_a_folder_without_results_is_refused(self):
        (self.folder / "results").mkdir()
        self.assertIn("found none", self.refuses("bench", "--benchmark", "report", "--input_path", self.folder / "results"))


class ResultsPage(unittest.TestCase):
    def test_the_page_is_what_the_committed_results_say(self):
        docs = pathlib.Path(os.environ["HOLBA_SOURCE_DIR"]) / "docs"
        page = subprocess.run([HOLBA, "bench", "--benchmark", "report", "--input_path", "results", "--quiet"],
                              cwd=docs, check=True, capture_output=True, text=True).stdout
        self.assertEqual(page.rstrip("\n"), (docs / "results.md").read_text().rstrip("\n"))


if __name__ == "__main__":
    unittest.main()
