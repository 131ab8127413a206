#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""The documentation says what is true: links lead somewhere, commands have the options that pages give them, and blocks
that are marked are run. HOLBA: the program.

A comment before a block of a page says what is done with it:
  <!-- test: run photographs -->   its commands run, in a folder of the page that has `images` and what blocks before made
  <!-- test: file PATH -->         it is the text of that file
  <!-- test: options -->           it needs data that tests lack: only its options are looked at, as those of all blocks
Python blocks without a mark, or with `test: run`, are run by python/tests/test_docs.py.
"""

import json
import os
import pathlib
import re
import shlex
import subprocess
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
HOLBA = os.environ.get("HOLBA", "holba")
PAGES = sorted([*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md"), *ROOT.glob(".github/**/*.md")])


def without_code(text: str) -> str:
    text = re.sub(r"^```.*?^```", "", text, flags=re.MULTILINE | re.DOTALL)
    return re.sub(r"`[^`\n]*`", "", re.sub(r"^    .*$", "", text, flags=re.MULTILINE))


def anchors(path: pathlib.Path) -> set:
    """As GitHub makes them of headings."""
    text = re.sub(r"^```.*?^```", "", path.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL)
    headings = re.findall(r"^#+ +(.*)$", text, flags=re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", h.lower()).strip().replace(" ", "-") for h in headings}


class Block:
    def __init__(self, page: pathlib.Path, line: int, language: str, mark: str, text: str, end: int = 0):
        self.page, self.line, self.language, self.mark, self.text = page, line, language, mark, text
        self.end = end  # last line of one that is indented
        self.place = f"{page.relative_to(ROOT)}:{line}"


def blocks(page: pathlib.Path) -> list:
    """Fenced and indented blocks with their marks."""
    found, mark, inside, language, begin = [], "", None, "", 0
    for number, line in enumerate(page.read_text(encoding="utf-8").splitlines(), 1):
        if inside is not None:
            if line.strip() == "```":
                found.append(Block(page, begin, language, mark, "\n".join(inside)))
                inside, mark = None, ""
            else:
                inside.append(line)
        elif line.lstrip().startswith("```"):
            inside, language, begin = [], line.strip().strip("`"), number
        elif re.match(r"<!-- test: (.*) -->$", line):
            mark = re.match(r"<!-- test: (.*) -->$", line).group(1)
        elif line.startswith("    "):
            if found and found[-1].end == number - 1:
                found[-1].text += "\n" + line[4:]
                found[-1].end = number
            else:
                found.append(Block(page, number, "", "", line[4:], end=number))
    return found


class Links(unittest.TestCase):
    def test_every_relative_link_leads_to_a_file_and_a_heading(self):
        broken = []
        for page in PAGES:
            for target in re.findall(r"\]\(([^)\s]+)\)", without_code(page.read_text(encoding="utf-8"))):
                if re.match(r"[a-z]+:", target):
                    continue
                path, _, anchor = target.partition("#")
                file = page if not path else (page.parent / path).resolve()
                if not file.exists():
                    broken.append(f"{page.relative_to(ROOT)}: {target}")
                elif anchor and file.suffix == ".md" and anchor not in anchors(file):
                    broken.append(f"{page.relative_to(ROOT)}: {target} (no such heading)")
        self.assertEqual(broken, [])

    def test_every_page_is_in_the_navigation_of_the_site(self):
        site = (ROOT / "mkdocs.yml").read_text(encoding="utf-8")
        for page in ROOT.glob("docs/**/*.md"):
            self.assertIn(str(page.relative_to(ROOT / "docs")), site)


class Commands(unittest.TestCase):
    tables: dict = {}

    def options(self, command: str) -> set:
        if command not in self.tables:
            result = subprocess.run([HOLBA, command, "--help", "json"], capture_output=True, text=True)
            self.assertEqual(result.returncode, 0, f"holba {command}: {result.stderr}")
            table = json.loads(result.stdout)
            self.tables[command] = {o["name"] for o in table["options"] + table["common_options"]} | {"help"}
        return self.tables[command]

    def test_every_command_of_a_page_has_its_options(self):
        count = 0
        for page in PAGES:
            if page.name == "CHANGELOG.md":
                continue
            for block in blocks(page):
                for line in block.text.replace("\\\n", " ").splitlines():
                    words = re.match(r"(?:\$ )?(?:build/bin/|\./)?holba ([a-z_]+)((?: .*)?)$", line.strip())
                    if not words or words.group(1) in ("man", "completion"):
                        continue
                    known = self.options(words.group(1))
                    count += 1
                    for word in shlex.split(words.group(2), comments=True):
                        if word.startswith("--"):
                            self.assertIn(word[2:].partition("=")[0], known, f"{block.place}: {line}")
        self.assertGreater(count, 50)

    def test_blocks_that_are_files_are_these_files(self):
        for page in PAGES:
            for block in blocks(page):
                if block.mark.startswith("file "):
                    text = (ROOT / block.mark[5:]).read_text(encoding="utf-8")
                    self.assertEqual(block.text.rstrip(), text.rstrip(), block.place)

    def test_every_marked_block_has_a_mark_that_is_known(self):
        for page in PAGES:
            for block in blocks(page):
                self.assertRegex(block.mark, r"^(run|run photographs|options|file .*|)$", block.place)


class Runs(unittest.TestCase):
    def run_page(self, name: str):
        page = ROOT / "docs" / f"{name}.md"
        with tempfile.TemporaryDirectory() as folder:
            tools = pathlib.Path(folder, "bin")
            tools.mkdir()
            (tools / "holba").symlink_to(pathlib.Path(HOLBA).resolve())
            work = pathlib.Path(folder, "work")
            subprocess.run([HOLBA, "render", "--output_path", work, "--quiet"], check=True)
            environment = {**os.environ, "PATH": f"{tools}:{os.environ['PATH']}"}
            count = 0
            for block in blocks(page):
                if block.mark != "run photographs":
                    continue
                # A page shows one thing in several ways: what it writes is written anew.
                text = f"set -euo pipefail\ncd {shlex.quote(str(work))}\n{block.text}"
                result = subprocess.run(["bash", "-c", text], capture_output=True, text=True, env=environment)
                self.assertEqual(result.returncode, 0, f"{block.place}:\n{block.text}\n{result.stdout}\n{result.stderr}")
                count += 1
            self.assertGreater(count, 0)

    def test_quick_start(self):
        self.run_page("quick_start")

    def test_tutorial(self):
        self.run_page("tutorial")

    def test_faq(self):
        self.run_page("faq")


if __name__ == "__main__":
    unittest.main()
