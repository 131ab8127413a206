# SPDX-License-Identifier: BSD-3-Clause
"""The messages of the program as its sources have them: each call that refuses an input or logs a message, with its
string literals. Tests, their helpers and fuzzers are left out."""

import dataclasses
import pathlib
import re

TEST_FILE = re.compile(r"(_test|_testing|_fuzz)\.(cc|h)$|/(fuzz_reader|random_model|import_golden_files)\.h$|/fuzz/")
# A comment, a raw string, a string (group 1: its text) or a character.
TOKEN = re.compile(r'//[^\n]*|/\*.*?\*/|R"(\w*)\((.*?)\)\1"|"((?:[^"\\\n]|\\.)*)"|\'(?:[^\'\\\n]|\\.)*\'', re.S)
REFUSAL = re.compile(r"\b(?:InputError(?:::At\w+)?|Fail(?:Record|At|Row)?|Refuse)\s*\(")
LOG = re.compile(r"\bLog(?:Warning|Info)\s*\(")


@dataclasses.dataclass
class Message:
    place: str  # path:line
    code: str  # the call with its arguments, comments left out
    texts: list[str]  # literals, those that stand side by side joined

    @property
    def text(self) -> str:
        return " ... ".join(self.texts)


def without_comments(code: str) -> str:
    """Comments become blanks; places of everything else stay."""
    def blank(match: re.Match) -> str:
        text = match.group()
        return re.sub(r"[^\n]", " ", text) if text.startswith(("//", "/*")) else text
    return TOKEN.sub(blank, code)


def literals(code: str) -> list[tuple[int, str]]:
    """Position and text of each string; those that the compiler joins are one."""
    found, end = [], None
    for match in TOKEN.finditer(code):
        if match.group()[0] not in 'R"':
            continue
        text = match.group(3) if match.group(3) is not None else match.group(2)
        if end is not None and not code[end:match.start()].strip():
            found[-1] = (found[-1][0], found[-1][1] + text)
        else:
            found.append((match.start(), text))
        end = match.end()
    return found


def call_at(code: str, begin: int) -> str:
    """The call whose opening parenthesis is the first from `begin` on."""
    depth, at = 0, begin
    while at < len(code):
        token = TOKEN.match(code, at)
        if token:
            at = token.end()
            continue
        depth += {"(": 1, ")": -1}.get(code[at], 0)
        at += 1
        if depth == 0 and code[at - 1] == ")":
            break
    return code[begin:at]


def files(source: pathlib.Path):
    for folder in ("src", "apps"):
        for file in sorted((source / folder).rglob("*")):
            path = file.relative_to(source).as_posix()
            if file.suffix in (".h", ".cc") and not TEST_FILE.search(path):
                yield path, without_comments(file.read_text())


def messages(source: pathlib.Path, call: re.Pattern) -> list[Message]:
    found = []
    for path, code in files(source):
        for match in call.finditer(code):
            text = call_at(code, match.start())
            found.append(Message(f"{path}:{code.count(chr(10), 0, match.start()) + 1}", re.sub(r"\s+", " ", text),
                                 [t for _, t in literals(text)]))
    return found


def all_literals(source: pathlib.Path) -> list[tuple[str, str]]:
    """Place and text of every string of the program."""
    return [(f"{path}:{code.count(chr(10), 0, at) + 1}", text)
            for path, code in files(source) for at, text in literals(code)]
