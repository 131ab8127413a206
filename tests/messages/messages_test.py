#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""What the program says, by rules that its sources are checked for: a refusal says what to do, in one sentence; the
system's words never stand alone; the same sentence is written once; words of the solver's inside stay inside.
Usage: messages_test.py SOURCE_FOLDER"""

import collections
import pathlib
import re
import sys
import unittest

from sources import LOG, REFUSAL, all_literals, messages

SOURCE = pathlib.Path(sys.argv.pop())
# Helpers that add the remedy themselves, or to which the caller hands a whole message.
ADDS_REMEDY = re.compile(
    r"\bFailRow\(|\bfail\(|NpzArchive|src/holba/frontend/importers/npz\.(cc|h)|"
    r"src/holba/frontend/photographs/(plain_files|tiff_file|png_file|jpeg_file)\.cc|"
    r"src/holba/(base/error\.h|io/binary_io\.h|io/text_io\.(h|cc)|frontend/importers/import_text\.h)")
# A refusal says what was expected, what must be, or, after a semicolon, what to do.
REMEDY = re.compile(
    r"\bexpected\b|\bmust\b|Remedy\b|kExpected|kTriangulateFirst|kMakeAnew|FaultOf|ThereTwice|NamesWhatIsMissing|IdNotInModel|"
    r"; (give|use|check|write|remove|rename|save|copy|fetch|match|mend|add|import|try|put|convert|delete|restore|see|"
    r"make|change|triangulate|bring|let|perhaps|--\w+)\b|; \{\}|; '|did you mean|see 'holba")
# Refusals whose messages are made elsewhere, and are checked there.
NAMED = re.compile(r"first\.reason|WhyNothingIsLeft|UnknownOption|UnknownCommand")
# The solver's words, which no user has met.
INSIDE = re.compile(r"\b(batch|slice|chunk|clique|panel|slot|node|parameter block|feature block|scratch|stage1|stage2)(e?s)?\b", re.I)
SYSTEM = re.compile(r"strerror|SystemFault\(\)|error\.message\(\)|error\.code\(\)\.message\(\)|\.what\(\)")


def sentences(text: str) -> list[str]:
    """Parts of at least five words between values and marks of punctuation."""
    parts = re.split(r"[;:]|\\n|\{[^}]*\}", text)
    return [part for part in (p.strip(" ,.'()") for p in parts) if len(part.split()) >= 5]


class Messages(unittest.TestCase):
    maxDiff = None

    def test_every_refusal_says_what_to_do(self):
        without = []
        for message in messages(SOURCE, REFUSAL):
            if not message.texts or ADDS_REMEDY.search(message.place + " " + message.code) or NAMED.search(message.code):
                continue
            if not REMEDY.search(message.code):
                without.append(f"{message.place}: {message.text}")
        self.assertEqual(without, [])

    def test_the_systems_words_never_stand_alone(self):
        bare = []
        for message in messages(SOURCE, re.compile(r"\bInputError(?:::At\w+)?\s*\(")):
            if SYSTEM.search(message.code) and not message.texts and "src/holba/base/" not in message.place:
                bare.append(f"{message.place}: {message.code}")
        # A message of an option in a file of options keeps its words, and gains the line.
        self.assertEqual([b for b in bare if "entry.line, error.what()" not in b], [])

    def test_no_message_is_of_two_sentences(self):
        two = [f"{m.place}: {t}" for call in (REFUSAL, LOG) for m in messages(SOURCE, call) for t in m.texts
               if re.search(r"[a-z)]\. [A-Z]|[a-z)}]\.$|!$", t)]
        self.assertEqual(two, [])

    def test_a_sentence_is_written_once(self):
        places = collections.defaultdict(set)
        for call in (REFUSAL, LOG):
            for message in messages(SOURCE, call):
                for text in message.texts:
                    for part in sentences(text):
                        places[part].add(message.place)
        self.assertEqual({part: sorted(at) for part, at in places.items() if len(at) > 1}, {})

    def test_words_of_the_solver_stay_inside(self):
        hits = [f"{m.place}: {t}" for call in (REFUSAL, LOG) for m in messages(SOURCE, call) for t in m.texts
                if INSIDE.search(t)]
        self.assertEqual(hits, [])

    def test_a_log_message_begins_with_a_capital_or_a_value(self):
        small = [f"{m.place}: {m.texts[0]}" for m in messages(SOURCE, LOG) if m.texts and re.match(r"[a-z]", m.texts[0])]
        self.assertEqual(small, [])

    def test_numbers_agree_with_their_nouns(self):
        """'{} images' would say '1 images': base/words.h counts."""
        nouns = (r"\{[^}]*\} (images|points|lines|groups|photographs|segments|pairs|cameras|rounds|iterations|threads|"
                 r"regions|matches|corners|positions|parts|links|normals)\b")
        hits = [f"{m.place}: {t}" for m in messages(SOURCE, LOG) for t in m.texts
                if re.search(nouns, t) and not m.place.startswith("apps/bench/")]
        self.assertEqual(hits, [])

    def test_the_rules_can_fail(self):
        self.assertIsNone(REMEDY.search('InputError(path, "cannot be read")'))
        self.assertIsNotNone(REMEDY.search('InputError(path, "there is no such file; check the path")'))
        self.assertEqual(sentences("{}: one two three four five; six"), ["one two three four five"])
        self.assertGreater(len(messages(SOURCE, REFUSAL)), 200)
        self.assertGreater(len(all_literals(SOURCE)), 1000)


if __name__ == "__main__":
    unittest.main()
