#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""The holba program as a user meets it. Environment: HOLBA, path of the program; HOLBA_VERSION, its version;
OLD_OPENBLAS, path of the library old_openblas."""

import json
import math
import os
import pathlib
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import unittest
from random import Random

from small_model import SMALL_MODEL, write_small_model

HOLBA = os.environ["HOLBA"]


def holba(*words, **kwargs) -> subprocess.CompletedProcess:
    return subprocess.run([HOLBA, *map(str, words)], capture_output=True, text=True, timeout=120,
                          **kwargs)


def records(path: pathlib.Path) -> list[str]:
    """The lines of a text file of a model that are not comments. An empty line may be a record."""
    return [line for line in path.read_text().split("\n") if not line.startswith("#")]


def tree(folder: pathlib.Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*"))
            if p.is_file()}


class Case(unittest.TestCase):
    def setUp(self):
        self._temporary = tempfile.TemporaryDirectory()
        self.addCleanup(self._temporary.cleanup)
        self.folder = pathlib.Path(self._temporary.name)
        self.model = self.folder / "model"
        write_small_model(self.model)

    def succeeds(self, *words, **kwargs) -> str:
        result = holba(*words, **kwargs)
        self.assertEqual(result.returncode, 0, result.stderr)
        return result.stdout

    def refuses(self, *words) -> str:
        """The one message of a run that must fail for what its user did."""
        result = holba(*words)
        self.assertEqual(result.returncode, 1, (words, result.stdout, result.stderr))
        self.assertEqual(result.stdout, "")
        message = result.stderr
        self.assertTrue(message.endswith("\n"))
        self.assertEqual(message.count("\n"), 1, message)
        self.assertNotIn("internal error", message)
        return message


def command_names() -> list[str]:
    listing = holba("help").stdout.split("Commands:\n")[1].split("\n\n")[0]
    return [line.split()[0] for line in listing.split("\n")]


class Help(Case):
    def test_no_word_help_and_dash_dash_help_say_the_same(self):
        texts = {self.succeeds(), self.succeeds("help"), self.succeeds("--help")}
        self.assertEqual(len(texts), 1)
        for name in ("convert", "transform"):
            self.assertIn(name, command_names())

    def test_version(self):
        version = self.succeeds("--version").splitlines()
        self.assertEqual(version[0], f"holba {os.environ['HOLBA_VERSION']}")
        self.assertEqual([line.split("  ")[0] for line in version[1:]], ["revision", "built", "with", "instruction set"])

    def test_help_of_every_command_is_complete(self):
        names = command_names()
        self.assertEqual(len(names), len(set(names)))
        for name in names:
            text = self.succeeds(name, "--help", "all")
            self.assertEqual(text, self.succeeds("help", name, "all"))
            self.assertIn(f"Usage: holba {name}", text)
            options = re.findall(r"^  --(\S+)(.*)\n((?:      .+\n)+)", text, re.MULTILINE)
            named = [option[0] for option in options]
            self.assertEqual(len(named), len(re.findall(r"^  --", text, re.MULTILINE)), name)
            for common in ("config", "log_level", "quiet", "help"):
                self.assertIn(common, named)
            for option, facts, sentence in options:
                self.assertRegex(option, r"^([A-Z][A-Za-z]*\.)*[A-Za-z0-9_]+$", name)
                self.assertTrue(sentence.endswith(".\n"), (name, option, sentence))
                if option not in ("quiet", "help", "json"):
                    self.assertRegex(facts, r"^ \S+  \((required|default: .*)\)$", (name, option))

    def test_the_short_help_lists_basic_options_on_one_screen(self):
        for name in command_names():
            text = self.succeeds(name, "--help")
            self.assertEqual(text, self.succeeds("help", name))
            self.assertEqual(text, self.succeeds(name, "-h"))
            self.assertIn(f"Usage: holba {name}", text)
            self.assertIn(f"'holba {name} --help all' has every option", " ".join(text.split()))
            self.assertLessEqual(len(text.splitlines()), 40, name)
            told = json.loads(self.succeeds(name, "--help", "json"))
            basic = [option["name"] for option in told["options"] + told["common_options"]
                     if option["level"] == "basic"]
            self.assertEqual(re.findall(r"^  --(\S+) .*\.$", text, re.MULTILINE), basic)
        self.assertIn("'everything'", self.refuses("convert", "--help", "everything"))
        self.assertIn("'more'", self.refuses("help", "convert", "all", "more"))

    def test_a_program_can_read_every_option(self):
        types = {"bool": bool, "int": int, "uint": int, "double": (int, float), "text": str,
                 "doubles": list, "choice": str}
        for name in command_names():
            whole = self.succeeds(name, "--help", "all")
            told = json.loads(self.succeeds("help", name, "json"))
            self.assertEqual(told["command"], name)
            options = told["options"] + told["common_options"]
            self.assertEqual([option["name"] for option in options],
                             re.findall(r"^  --(\S+)", whole, re.MULTILINE))
            for option in options:
                self.assertIsInstance(option["default"], types[option["type"]], option)
                self.assertEqual(isinstance(option["default"], bool), option["type"] == "bool")
                self.assertTrue(option["sentence"].endswith("."))

    def test_the_readme_lists_exactly_the_commands_that_exist(self):
        readme = (pathlib.Path(__file__).parents[2] / "README.md").read_text()
        table = readme.split("## Commands")[1].split("## ")[0]
        self.assertEqual(sorted(re.findall(r"^\| `(\w+)` \|", table, re.MULTILINE)),
                         sorted(command_names()))

    def test_required_options_are_required(self):
        for name in command_names():
            options = json.loads(holba(name, "--help", "json").stdout)["options"]
            if any(option["required"] for option in options):
                self.assertIn("must be given", self.refuses(name))


class Errors(Case):
    def test_unknown_command_names_the_nearest(self):
        self.assertIn("did you mean 'convert'?", self.refuses("convret"))
        self.assertIn("unknown command 'qqqqqqq'", self.refuses("qqqqqqq"))
        self.assertIn("unknown command", self.refuses("help", "qqqqqqq"))
        self.assertIn("expected a command", self.refuses("--input_path", "x"))

    def test_bad_words_are_refused_and_leave_the_output_untouched(self):
        output = self.folder / "output"
        output.mkdir()
        (output / "mine").write_text("untouched")
        before = tree(output)
        paths = ("--input_path", self.model, "--output_path", output)
        for words, part in [
                (("convert", *paths, "--output_tpye", "txt"), "did you mean '--output_type'?"),
                (("convert", *paths, "--output_type", "doc"), "one of txt|bin|limap|nerfstudio|ply"),
                (("convert", *paths, "--output_type"), "--output_type"),
                (("convert", *paths, "stray"), "unexpected argument 'stray'"),
                (("convert", "--output_path", output), "--input_path must be given"),
                (("convert", "--input_path", self.model), "--output_path must be given"),
                (("convert", "--input_path", "", "--output_path", output), "--input_path must be given"),
                (("transform", *paths, "--scale", "0"), "greater than 0"),
                (("transform", *paths, "--scale", "large"), "'large'"),
                (("transform", *paths, "--scale", "nan"), "'nan'"),
                (("transform", *paths, "--rotation", "1,0,0"), "4 numbers"),
                (("transform", *paths, "--rotation", "0,0,0,0"), "zero quaternion"),
                (("transform", *paths, "--translation", "1,2,"), "1,2,"),
                (("transform", *paths, "--scale", "2", "--transform_path", "t"), "--transform_path"),
                (("transform", *paths, "--transform_path", self.folder / "no.json"), "no.json"),
                (("transform", *paths, "--log_level", "loud"), "debug|info|warning|error|off"),
        ]:
            with self.subTest(words=words[0], part=part):
                self.assertIn(part, self.refuses(*words))
                self.assertEqual(tree(output), before)

    def test_a_missing_input_of_any_command_is_named_and_nothing_is_written(self):
        absent, output = self.folder / "absent", self.folder / "output"
        tried = 0
        for name in command_names():
            options = json.loads(holba(name, "--help", "json").stdout)["options"]
            required = [option["name"] for option in options if option["required"]]
            if "input_path" not in required:
                continue
            values = {"input_path": absent, "output_path": output, "dataset": "ETH3D"}
            words = [word for option in required
                     for word in (f"--{option}", values.get(option, self.model))]
            if name == "evaluate_geometry":
                words += ["--mesh_path", self.model]  # one truth of several
            self.assertIn(str(absent), self.refuses(name, *words))
            self.assertFalse(output.exists())
            tried += 1
        self.assertGreaterEqual(tried, 2)

    def test_a_damaged_input_is_named_with_its_place_and_the_output_stays(self):
        lines = (self.model / "points3D.txt").read_text().split("\n")
        number = next(i for i, line in enumerate(lines) if not line.startswith("#"))
        lines[number] = lines[number].replace(" ", " x", 1)
        (self.model / "points3D.txt").write_text("\n".join(lines))
        output = self.folder / "output"
        message = self.refuses("convert", "--input_path", self.model, "--output_path", output)
        self.assertIn(f"points3D.txt:{number + 1}", message)
        self.assertFalse(output.exists())

    def test_an_output_that_cannot_be_made_is_named(self):
        (self.folder / "file").write_text("")
        output = self.folder / "file" / "output"
        message = self.refuses("convert", "--input_path", self.model, "--output_path", output)
        self.assertIn(str(self.folder / "file"), message)

    def test_an_output_of_any_command_is_tried_before_the_input_is_read(self):
        absent, tried = self.folder / "absent", []
        (self.folder / "file").write_text("")
        (self.folder / "taken" / "cameras.bin").mkdir(parents=True)
        before = tree(self.folder)
        for name in command_names():
            options = json.loads(holba(name, "--help", "json").stdout)["options"]
            names = [option["name"] for option in options]
            if "output_path" not in names:
                continue
            tried.append(name)
            words = [word for option in options if option["required"] and option["name"] != "output_path"
                     for word in (f"--{option['name']}", "ETH3D" if option["name"] == "dataset" else absent)]
            if name == "evaluate_geometry":
                words += ["--mesh_path", absent]  # one truth of several
            # No folder can be made in the first (not even by root) nor in the second.
            for output in ("/proc/no/such", self.folder / "file" / "output", self.folder / "file",
                           self.folder / ("n" * 300), self.folder / "taken"):
                if name in ("map", "reconstruct", "render", "synthesize", "import", "evaluate_geometry", "bench") and \
                        output == self.folder / "taken":
                    continue  # it writes into folders, or files, of its own
                if name == "view" and output == self.folder / "file":
                    continue  # a page takes the place of a file
                with self.subTest(command=name, output=str(output)[:200]):
                    message = self.refuses(name, *words, "--output_path", output)
                    self.assertIn(str(output), message)
                    self.assertNotIn(str(absent), message)
            if "database_path" in names:
                if "--database_path" in words:
                    at = words.index("--database_path")
                    del words[at:at + 2]
                message = self.refuses(name, *words, "--output_path", self.folder / "output", "--database_path",
                                       "/proc/no.db")
                self.assertIn("/proc/no.db", message)
            if name == "convert":
                for output in ("/proc/no.ply", self.folder):
                    message = self.refuses(name, *words, "--output_type", "ply", "--output_path", output)
                    self.assertIn(str(output), message)
        self.assertLessEqual({"adjust", "convert", "synthesize", "transform"}, set(tried))
        self.assertEqual(tree(self.folder), before)
        self.assertFalse((self.folder / "output").exists())

    def test_a_standard_output_that_takes_nothing_is_found_before_the_input_is_read(self):
        for name in ("evaluate", "adjust"):
            words = ["--input_path", self.folder / "absent"]
            if name == "adjust":
                words += ["--output_path", self.folder / "output"]
            with open("/dev/full", "w") as full:
                result = subprocess.run([HOLBA, name, *map(str, words)], stdout=full, stderr=subprocess.PIPE, text=True)
            self.assertEqual(result.returncode, 1)
            self.assertIn("standard output", result.stderr)

    def test_a_result_that_cannot_be_printed_is_a_failure(self):
        with open("/dev/full", "w") as full:
            result = subprocess.run([HOLBA, "help"], stdout=full, stderr=subprocess.PIPE, text=True)
        self.assertEqual(result.returncode, 1)
        self.assertIn("standard output", result.stderr)


class Config(Case):
    def config(self, text: str) -> pathlib.Path:
        path = self.folder / "holba.ini"
        path.write_text(text)
        return path

    def test_a_byte_order_mark_is_skipped_and_utf_16_named(self):
        output = self.folder / "output"
        config = self.config("")
        text = f"input_path = {self.model}\noutput_path = {output}\n"
        config.write_bytes(b"\xef\xbb\xbf" + text.encode())
        self.succeeds("convert", "--config", config)
        config.write_bytes(text.encode("utf-16"))
        self.assertIn("found UTF-16; save it as UTF-8", self.refuses("convert", "--config", config))

    def test_the_command_line_overrides_the_file_and_the_file_the_default(self):
        output = self.folder / "output"
        config = self.config(f"input_path = {self.model}\noutput_path = {output}\noutput_type = txt\n")
        self.succeeds("convert", "--config", config)
        self.assertTrue((output / "cameras.txt").exists())
        other = self.folder / "other"
        self.succeeds("convert", "--config", config, "--output_path", other, "--output_type", "bin")
        self.assertTrue((other / "cameras.bin").exists())
        self.assertFalse((other / "cameras.txt").exists())

    def test_a_fault_in_the_file_is_named_with_its_line(self):
        output = self.folder / "output"
        paths = f"input_path = {self.model}\noutput_path = {output}\n"
        for text, part in [(paths + "\noutput_tpye = txt\n", "holba.ini:4: unknown option"),
                           (paths + "[Section]\noutput_type = txt\n", "holba.ini:4: unknown option"),
                           (paths + "output_type = doc\n", "holba.ini:3: "),
                           (paths + "nonsense\n", "holba.ini:3: expected")]:
            self.assertIn(part, self.refuses("convert", "--config", self.config(text)))
            self.assertFalse(output.exists())


class Convert(Case):
    def convert(self, source: pathlib.Path, kind: str, name: str) -> pathlib.Path:
        output = self.folder / name
        self.succeeds("convert", "--input_path", source, "--output_path", output,
                      "--output_type", kind)
        return output

    def test_text_to_binary_to_text_loses_nothing(self):
        binary = self.convert(self.model, "bin", "binary")
        text = self.convert(binary, "txt", "text")
        again = self.convert(text, "bin", "again")
        for name in SMALL_MODEL:
            self.assertFalse((binary / f"{name}.txt").exists())
            self.assertEqual(records(text / f"{name}.txt"), records(self.model / f"{name}.txt"), name)
        self.assertEqual(tree(binary), tree(again))
        for folder in (binary, text):
            frame = json.loads((folder / "holistic.json").read_text())
            self.assertEqual(frame["format"], 1)
            self.assertEqual(frame["frame"]["num_images"], 2)
            # Camera centres (0, 0, 0) and (1, 0, 0).
            for found, expected in zip(frame["frame"]["centroid"], (0.5, 0.0, 0.0)):
                self.assertAlmostEqual(found, expected, places=12)
            self.assertAlmostEqual(frame["frame"]["spread"], 0.5, places=12)

    def test_ply_holds_the_points_and_lines(self):
        path = self.convert(self.model, "ply", "model.ply")
        header = path.read_bytes().split(b"end_header\n")[0].decode()
        self.assertTrue(header.startswith("ply\n"))
        self.assertRegex(header, r"element vertex \d+\n")

    def test_a_bal_problem_becomes_a_model_and_again_the_problem(self):
        problem = [[2, 1, 2], [0, 0, -3.5, 4.25], [1, 0, 10.5, -20],
                   *([x] for x in (0.1, -0.2, 0.3, 1, 2, -30, 500, 0.01, -0.002)),
                   *([x] for x in (0, 0.25, 0, -1, 2, -31, 510.5, 0, 0)),
                   *([x] for x in (1.5, -2.5, 3.5))]
        source = self.folder / "problem.txt"
        source.write_text("".join(" ".join(map(str, line)) + "\n" for line in problem))
        model = self.convert(source, "bin", "of_bal")
        self.assertTrue((model / "points3D.bin").exists())
        again = self.convert(model, "bal", "again.txt")
        expected = [float(x) for line in problem for x in line]
        found = [float(x) for x in again.read_text().split()]
        self.assertEqual(len(found), len(expected))
        for x, y in zip(found, expected):
            self.assertAlmostEqual(x, y, places=12)

    def test_results_are_silent_on_stdout_and_quiet_on_stderr(self):
        result = holba("convert", "--input_path", self.model, "--output_path", self.folder / "o",
                       "--quiet")
        self.assertEqual((result.returncode, result.stdout, result.stderr), (0, "", ""))

    def test_names_that_colmap_cuts_in_text_are_warned_of(self):
        images = (self.model / "images.txt").read_text()
        words = ("convert", "--input_path", self.model, "--output_path", self.folder / "out")
        self.assertIn("sub folder/second.jpg", images)
        result = holba(*words, "--output_type", "txt")
        self.assertEqual(result.returncode, 0)
        self.assertIn("'sub folder/second.jpg'", result.stderr)
        self.assertIn("--output_type bin", result.stderr)
        self.assertNotIn("blanks", holba(*words, "--output_type", "bin").stderr)
        (self.model / "images.txt").write_text(images.replace("sub folder/", ""))
        self.assertNotIn("blanks", holba(*words, "--output_type", "txt").stderr)

    def test_the_output_may_be_the_input(self):
        before = {name: records(self.model / f"{name}.txt") for name in SMALL_MODEL}
        self.succeeds("convert", "--input_path", self.model, "--output_path", self.model,
                      "--output_type", "txt")
        self.assertEqual(before, {name: records(self.model / f"{name}.txt") for name in SMALL_MODEL})


class Transform(Case):
    def test_a_transformation_that_cannot_be_read_is_named(self):
        for path, message in [(self.folder, "expected a file, found a folder or device"),
                              (self.folder / "none.json", "there is no such file")]:
            self.assertIn(f"{path}: {message}", self.refuses(
                "transform", "--input_path", self.model, "--output_path", self.folder / "o",
                "--transform_path", path))

    def transform(self, source: pathlib.Path, name: str, *words) -> pathlib.Path:
        output = self.folder / name
        self.printed = self.succeeds("transform", "--input_path", source, "--output_path", output,
                                     "--output_type", "txt", *words)
        return output

    @staticmethod
    def numbers(folder: pathlib.Path, name: str) -> list[list[float]]:
        return [[float(word) for word in line.split() if re.match(r"^[-+.\d]", word)]
                for line in records(folder / f"{name}.txt") if line]

    def assert_same_numbers(self, a: pathlib.Path, b: pathlib.Path):
        for name in SMALL_MODEL:
            for x, y in zip(self.numbers(a, name), self.numbers(b, name), strict=True):
                self.assertEqual(len(x), len(y))
                for u, v in zip(x, y):
                    self.assertAlmostEqual(u, v, places=10, msg=name)

    def test_points_move_by_the_similarity(self):
        # A quarter turn about z: (x, y, z) -> (-y, x, z).
        moved = self.transform(self.model, "moved", "--scale", 2, "--rotation", "1,0,0,1",
                               "--translation", "1,-2,3")
        for old, new in zip(self.numbers(self.model, "points3D"), self.numbers(moved, "points3D")):
            x, y, z = old[1:4]
            for found, expected in zip(new[1:4], (-2 * y + 1, 2 * x - 2, 2 * z + 3)):
                self.assertAlmostEqual(found, expected, places=12)

    def test_the_inverse_undoes_it_everywhere(self):
        there = self.transform(self.model, "there", "--scale", 4, "--rotation", "0,1,0,0",
                               "--translation", "1,2,3")
        # R = diag(1, -1, -1): x = R (y - t) / 4.
        (self.folder / "back.json").write_text(json.dumps(
            {"scale": 0.25, "rotation": [0, -1, 0, 0], "translation": [-0.25, 0.5, 0.75]}))
        back = self.transform(there, "back", "--transform_path", self.folder / "back.json")
        self.assert_same_numbers(back, self.model)

    def test_the_printed_similarity_is_what_was_applied(self):
        moved = self.transform(self.model, "moved", "--normalize", 1, "--scale", 3, "--json")
        printed = json.loads(self.printed)
        (self.folder / "t.json").write_text(self.printed)
        again = self.transform(self.model, "again", "--transform_path", self.folder / "t.json")
        self.assert_same_numbers(moved, again)
        # Centres (0, 0, 0) and (1, 0, 0) are 1 apart; normalised 10, then 3 times that.
        self.assertAlmostEqual(printed["scale"], 30.0, places=12)
        self.assertAlmostEqual(printed["translation"][0], -15.0, places=12)

    def test_bad_files_are_refused(self):
        path = self.folder / "t.json"
        output = self.folder / "output"
        for text, part in [('{"scale": 0}', "greater than 0"), ('{"scala": 1}', "'scala'"),
                           ('{"rotation": [1, 0]}', "4 numbers"), ("[1]", 'expected {"scale": s'),
                           ('{"scale": "big"}', "t.json"), ("{", "t.json")]:
            path.write_text(text)
            self.assertIn(part, self.refuses("transform", "--input_path", self.model,
                                             "--output_path", output, "--transform_path", path))
            self.assertFalse(output.exists())


class Demo(Case):
    def test_what_the_demo_does_brings_a_start_nearer_to_the_truth(self):
        scene = self.folder / "scene"
        self.succeeds("synthesize", "--output_path", scene, "--num_images", 12, "--seed", 1)

        def errors(model: pathlib.Path, name: str) -> dict[str, float]:
            text = self.succeeds("evaluate", "--input_path", model, "--ground_truth_path",
                                 scene / "truth", "--json")
            (self.folder / f"{name}.json").write_text(text)
            return json.loads(text)["ground_truth"]

        start = errors(scene / "perturbed", "start")
        for config in ("point", "point_line", "groups", "holistic"):
            adjusted = self.folder / config
            self.succeeds("adjust", "--input_path", scene / "perturbed", "--output_path", adjusted,
                          "--Bundle.config", config)
            found = errors(adjusted, config)
            for key in ("rotation_rms_deg", "position_rms", "point_rms"):
                self.assertLess(found[key], 0.5 * start[key], (config, key))
        script = pathlib.Path(__file__).parents[2] / "cmake" / "demo_table.py"
        table = subprocess.run([sys.executable, script, self.folder], capture_output=True, text=True,
                               check=True).stdout.split("\n")
        self.assertEqual([line.split()[0] for line in table[3:8]],
                         ["start", "point", "point-line", "groups", "holistic"])
        for line in table[3:8]:
            self.assertEqual(len(line.split()), 8)
            self.assertNotIn(" - ", line)
        self.assertTrue(table[8].startswith("With all structure, "))


class Blas(Case):
    def start(self, **variables) -> tuple[int, str]:
        """With an old OpenBLAS: how often the program started, and what it says of the kernels."""
        environment = {name: value for name, value in os.environ.items()
                       if not name.startswith(("OPENBLAS_", "OMP_", "GOTO_"))}
        starts = self.folder / "starts"
        starts.write_text("")
        environment |= {"LD_PRELOAD": os.environ["OLD_OPENBLAS"], "OLD_OPENBLAS_STARTS": str(starts)}
        result = holba("convert", "--input_path", self.model, "--output_path", self.folder / "a b",
                       "--log_level", "debug", env=environment | variables)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertTrue((self.folder / "a b" / "cameras.bin").exists())
        core = re.search(r"OPENBLAS_CORETYPE=(\w+)", result.stderr)
        return starts.read_text().count("start"), core[1] if core else ""

    def test_kernels_older_than_the_cpu_are_replaced_by_one_new_start(self):
        flags = set(re.search(r"^flags\s*: (.*)$", pathlib.Path("/proc/cpuinfo").read_text(),
                              re.MULTILINE)[1].split())
        if {"avx512f", "avx512cd", "avx512dq", "avx512bw", "avx512vl", "avx2", "fma"} <= flags:
            expected = "SKYLAKEX"
        elif {"avx2", "fma"} <= flags:
            expected = "HASWELL"
        else:
            self.assertEqual(self.start(), (1, ""))
            return
        # The second start does not ask: the variable is set.
        self.assertEqual(self.start(), (1, expected))

    def test_a_choice_of_the_user_stays(self):
        self.assertEqual(self.start(OPENBLAS_CORETYPE="Nehalem"), (0, "Nehalem"))


class Signals(Case):
    def test_an_interrupted_run_leaves_the_old_output_or_a_whole_new_one(self):
        # Many points make the run long enough that interrupts fall before, into and after the writing.
        points = ["# many"] + [f"{i} {i / 7!r} {math.sin(i)!r} 5 1 2 3 -1" for i in range(1, 120001)]
        big = self.folder / "big"
        write_small_model(big, {"points3D": "\n".join(points) + "\n"})
        old = tree(self.model)
        arguments = [HOLBA, "convert", "--input_path", str(big), "--output_type", "txt", "--quiet"]
        whole = self.folder / "whole"
        begin = time.monotonic()
        self.succeeds(*arguments[1:], "--output_path", whole)
        seconds = time.monotonic() - begin
        new = tree(whole)
        interrupted = 0
        for step in range(16):
            work = self.folder / f"work{step}"
            output = work / "output"
            for name, content in old.items():
                (output / name).parent.mkdir(parents=True, exist_ok=True)
                (output / name).write_bytes(content)
            process = subprocess.Popen([*arguments, "--output_path", str(output)],
                                       stdout=subprocess.PIPE, stderr=subprocess.PIPE)
            time.sleep(seconds * (step + 0.5) / 14)
            process.terminate()
            process.communicate(timeout=60)
            interrupted += process.returncode == -signal.SIGTERM
            self.assertIn(process.returncode, (0, -signal.SIGTERM))
            self.assertEqual([p.name for p in work.iterdir()], ["output"], "something was left behind")
            self.assertIn(tree(output), (old, new))
        self.assertGreater(interrupted, 0)

    def test_a_killed_run_leaves_the_old_output_or_a_whole_new_one_and_the_next_cleans_up(self):
        points = ["# many"] + [f"{i} {i / 7!r} {math.sin(i)!r} 5 1 2 3 -1" for i in range(1, 120001)]
        big = self.folder / "big"
        write_small_model(big, {"points3D": "\n".join(points) + "\n"})
        work = self.folder / "work"
        other = {"note": b"not of holba", "folder/note": b"nor this"}
        num_kills = int(os.environ.get("HOLBA_NUM_KILLS", 12))
        random = Random(3)
        for output_type in ("txt", "ply"):
            output = work / "output"
            words = ("convert", "--output_type", output_type, "--quiet", "--output_path", output)

            def run(source: pathlib.Path) -> tuple[dict, float]:
                begin = time.monotonic()
                self.succeeds(*words, "--input_path", source)
                return tree(work), time.monotonic() - begin

            if output_type != "ply":
                for name, content in other.items():
                    (output / name).parent.mkdir(parents=True, exist_ok=True)
                    (output / name).write_bytes(content)
            old, _ = run(self.model)
            new, seconds = run(big)
            self.assertNotEqual(old, new)
            counts = dict.fromkeys(("killed", "left old", "left new", "left a stage"), 0)
            for kill in range(num_kills):
                self.assertEqual(run(self.model)[0], old, "something was left behind")
                process = subprocess.Popen([HOLBA, *map(str, words), "--input_path", str(big)])
                time.sleep(random.uniform(0, 1.1 * seconds))
                process.kill()
                process.wait(timeout=60)
                counts["killed"] += process.returncode == -signal.SIGKILL
                left = {name: data for name, data in tree(work).items() if not name.startswith(".")}
                self.assertIn(left, (old, new))
                counts["left old"] += left == old
                counts["left new"] += left == new
                counts["left a stage"] += len(os.listdir(work)) > 1
            self.assertEqual(run(big)[0], new)
            self.assertEqual(os.listdir(work), ["output"])
            print(f"convert to {output_type}, {num_kills} runs: {counts}")
            self.assertGreater(counts["killed"], 0)
            shutil.rmtree(work)


if __name__ == "__main__":
    unittest.main()
