#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""The walls of the house: a file of src/holba includes only headers of its own room and of those that the room
DEPENDS on (directly or through others) in its CMakeLists.txt, apps see everything, no room sees apps. The linker
enforces this for what has a library; headers alone are checked here. Usage: rooms_test.py SOURCE_FOLDER"""

import pathlib
import re
import sys
import unittest

SOURCE = pathlib.Path(sys.argv.pop())
ROOMS = SOURCE / "src" / "holba"
# Helpers of tests, like the tests themselves, may link what the room does not.
TEST_FILE = re.compile(r"(_test|_testing|_fuzz|_testing_simd)\.(cc|h)$|/(fuzz_reader|random_model|test_scenes|test_models|"
                       r"camera_examples|import_golden_files)\.h$")


def rooms_and_dependencies() -> dict[str, set[str]]:
    """For each room (path below src/holba) the rooms that its holba_room(...) names after DEPENDS."""
    rooms = {}
    for file in sorted(ROOMS.rglob("CMakeLists.txt")):
        text = re.sub(r"#.*", "", file.read_text())
        for arguments in re.findall(r"holba_room\(([^)]*)\)", text):
            words = arguments.split()
            depends = set()
            if "DEPENDS" in words:
                for word in words[words.index("DEPENDS") + 1:]:
                    if word in ("PUBLIC", "PRIVATE", "EXCLUDE"):
                        break
                    depends.add(word)
            rooms.setdefault(words[0], set()).update(depends)
    return rooms


DEPENDENCIES = rooms_and_dependencies()


def allowed(room: str) -> set[str]:
    """The room itself and all that it depends on."""
    seen, open_rooms = set(), [room]
    while open_rooms:
        current = open_rooms.pop()
        if current not in seen:
            seen.add(current)
            open_rooms += DEPENDENCIES[current]
    return seen


def room_of(path: str) -> str | None:
    """The room of a path below src/holba: the deepest folder that is one."""
    parts = path.split("/")[:-1]
    while parts:
        if "/".join(parts) in DEPENDENCIES:
            return "/".join(parts)
        parts.pop()
    return None


def includes(file: pathlib.Path) -> list[str]:
    return re.findall(r'^\s*#\s*include\s+"([^"]+)"', file.read_text(), re.MULTILINE)


class Rooms(unittest.TestCase):
    def sources(self):
        for file in sorted(ROOMS.rglob("*")):
            if file.suffix in (".h", ".cc"):
                yield file, file.relative_to(ROOMS).as_posix()

    def test_every_source_is_in_a_room_and_every_room_has_sources(self):
        found = set()
        for _, path in self.sources():
            room = room_of(path)
            self.assertIsNotNone(room, f"{path} is in no room: no holba_room() in its folder or above")
            found.add(room)
        self.assertEqual(found, set(DEPENDENCIES))

    def test_rooms_depend_on_rooms_and_not_on_each_other(self):
        for room, depends in DEPENDENCIES.items():
            self.assertLessEqual(depends, set(DEPENDENCIES), f"{room} depends on what is no room")
            for other in depends:
                self.assertNotIn(room, allowed(other), f"{room} and {other} depend on each other")

    def test_includes_follow_the_arrows(self):
        against = []
        for file, path in self.sources():
            if TEST_FILE.search("/" + path):
                continue
            room = room_of(path)
            for include in includes(file):
                if include.startswith("apps/"):
                    against.append(f"{path} includes {include}: no room sees apps")
                if include.startswith("holba/"):
                    used = room_of(include[len("holba/"):])
                    if used not in allowed(room):
                        against.append(f"{path} includes {include}: {room} does not depend on {used}")
        self.assertEqual(against, [])

    def test_core_headers_know_no_ceres_no_opencv_and_no_python(self):
        foreign = re.compile(r'#\s*include\s+<(ceres/|opencv2/|pybind11/|nanobind/|Python\.h)')
        hits = [path for file, path in self.sources()
                if file.suffix == ".h" and not path.startswith("solver/ceres/") and not path.startswith("frontend/")
                and not TEST_FILE.search("/" + path) and foreign.search(file.read_text())]
        self.assertEqual(hits, [])

    def test_a_forbidden_include_would_be_seen(self):
        """The check itself can fail: scene does not see bundle, bundle sees scene."""
        self.assertNotIn("bundle", allowed("scene"))
        self.assertIn("scene", allowed("bundle"))
        self.assertEqual(room_of("estimation/lines/line_fit.h"), "estimation/lines")
        self.assertEqual(room_of("io/fuzz/bal_fuzz.cc"), "io")


if __name__ == "__main__":
    unittest.main()
