#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Completion for shells and manual pages, made by the program of its options. Environment: as cli_test.py."""

import json
import re
import shutil
import subprocess
import sys
import unittest

from cli_test import Case


class Shell(Case):
    """What shells and man are told: all of what the help knows."""

    def options(self, command: str) -> list[str]:
        table = json.loads(self.succeeds(command, "--help", "json"))
        return [option["name"] for option in table["options"] + table["common_options"]]

    def commands(self) -> list[str]:
        return re.findall(r"^  ([a-z_]+) ", self.succeeds("help"), re.M)

    def test_every_option_is_completed_and_has_its_entry_in_the_manual(self):
        scripts = {shell: self.succeeds("completion", shell) for shell in ("bash", "zsh", "fish")}
        self.assertGreater(len(self.commands()), 8)
        for command in self.commands():
            page = self.succeeds("man", command)
            self.assertIn(f"holba\\-{command} \\- ".replace("_", "_"), page)
            self.assertIn(f"holba\\-{command}", self.succeeds("man"))
            for name in self.options(command):
                roff = name.replace("-", "\\-")
                self.assertIn(f"\\fB\\-\\-{roff}\\fR", page)
                self.assertIn(f"--{name}", scripts["bash"])
                self.assertIn(f"--{name}[", scripts["zsh"])
                self.assertIn(f"__fish_seen_subcommand_from {command}' -l {name} ", scripts["fish"])

    def complete(self, *words: str) -> list[str]:
        script = self.succeeds("completion", "bash")
        quoted = " ".join(f"'{word}'" for word in words)
        result = subprocess.run(["bash", "-c", f"{script}\nCOMP_WORDS=({quoted}) COMP_CWORD={len(words) - 1}\n_holba\n"
                                 'printf "%s\\n" "${COMPREPLY[@]}"'], capture_output=True, text=True, cwd=self.folder)
        self.assertEqual(result.returncode, 0, result.stderr)
        return result.stdout.split()

    def test_bash_completes_commands_options_choices_and_paths(self):
        self.assertEqual(self.complete("holba", "conv"), ["convert"])
        self.assertEqual(self.complete("holba", "adjust", "--Solver.back"), ["--Solver.backend"])
        self.assertIn("nerfstudio", self.complete("holba", "convert", "--output_type", ""))
        self.assertEqual(self.complete("holba", "adjust", "--Solver.analyse", ""), self.complete("holba", "adjust", ""))
        (self.folder / "a model").mkdir()
        self.assertEqual(self.complete("holba", "adjust", "--input_path", "a"), ["a", "model"])
        self.assertEqual(self.complete("holba", "adjust", "--Solver.max_num_iterations", ""), [])

    def test_other_shells_take_their_scripts(self):
        for shell, check in (("zsh", ["zsh", "-n"]), ("fish", ["fish", "--no-execute"])):
            if shutil.which(shell):
                script = self.folder / shell
                script.write_text(self.succeeds("completion", shell))
                result = subprocess.run([*check, script], capture_output=True, text=True)
                self.assertEqual(result.returncode, 0, result.stderr)
        self.assertIn("expected bash, zsh or fish, found 'csh'", self.refuses("completion", "csh"))
        self.assertIn("found 'adjsut'", self.refuses("man", "adjsut"))

    def test_the_manual_is_sound(self):
        if not shutil.which("groff"):
            self.skipTest("SKIPPED, NOT TESTED: no groff")
        for command in ["", *self.commands()]:
            page = self.succeeds("man", *([command] if command else []))
            result = subprocess.run(["groff", "-man", "-Tascii", "-ww", "-z"], input=page, capture_output=True, text=True)
            self.assertEqual(result.stderr, "", command)


if __name__ == "__main__":
    sys.exit(0 if unittest.main(exit=False, verbosity=2).result.wasSuccessful() else 1)
