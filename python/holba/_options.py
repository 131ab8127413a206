# SPDX-License-Identifier: BSD-3-Clause
"""Options as keywords: names, types, ranges and sentences are those of the program's option tables."""

from __future__ import annotations

import keyword
import os
import re
from dataclasses import dataclass
from typing import Any, Dict, List, Mapping, Sequence, Union

from . import _core
from ._errors import InputError

Value = Union[bool, int, float, str, List[float]]


@dataclass(frozen=True)
class Option:
    """One option of a function.

    keyword: as Python takes it; name: as the program has it ("Solver.max_num_iterations"), which is taken, too.
    type: bool, int, uint, double, text, doubles or choice (one of choices). range: in words, empty: any value.
    """

    keyword: str
    name: str
    section: str
    type: str
    choices: Sequence[str]
    default: Value
    range: str
    sentence: str
    basic: bool
    required: bool


# Tables of functions that are no commands, or that have other options than the command of their name.
_TABLES: Dict[str, Any] = {
    "adjust": _core.AdjustOptions,
    "mapper": _core.MapperOptions,
    "solve": _core.SolveOptions,
}


def _snake(name: str) -> str:
    """SiftExtraction.max_num_features -> sift_extraction_max_num_features."""
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", name).replace(".", "_").lower()


def _keywords(described: Sequence[Mapping[str, Any]]) -> Dict[str, str]:
    """Keyword of each option name: its last part where no other option has that, else all of it."""
    last = [d["name"].rsplit(".", 1)[-1] for d in described]
    plain = {d["name"] for d in described if "." not in d["name"]}
    keywords = {}
    for d, short in zip(described, last):
        name = d["name"]
        is_own = name == short or (last.count(short) == 1 and short not in plain)
        word = _snake(short) if is_own else _snake(name)
        keywords[name] = word + "_" if keyword.iskeyword(word) else word  # from_
    return keywords


class OptionTable:
    """The options of one function, and how keywords become values of them."""

    def __init__(self, make: Any) -> None:
        self._make = make
        described = make().describe()
        keywords = _keywords(described)
        self.options: List[Option] = [
            Option(
                keyword=keywords[d["name"]],
                name=d["name"],
                section=d["section"],
                type=d["type"],
                choices=tuple(d["choices"]),
                default=d["default"],
                range=d["range"],
                sentence=d["sentence"],
                basic=d["basic"],
                required=d["required"],
            )
            for d in described
        ]
        self._name_of: Dict[str, str] = {}
        for option in self.options:
            self._name_of[option.name] = option.name
            self._name_of[_snake(option.name)] = option.name
        for option in self.options:
            self._name_of[option.keyword] = option.name

    def bind(self, given: Mapping[str, Any]) -> Any:
        """An option set with these values. Raises InputError for unknown keywords and values not allowed."""
        made = self._make()
        for word, value in given.items():
            name = self._name_of.get(word)
            if name is None:
                raise InputError(self._unknown(word))
            if isinstance(value, os.PathLike):
                value = os.fspath(value)
            made.set(name, value)
        missing = [o.keyword for o in self.options if o.required and not self._has(given, o)]
        if missing:
            raise InputError(f"{missing[0]} must be given")
        return made

    def _has(self, given: Mapping[str, Any], option: Option) -> bool:
        return any(self._name_of.get(word) == option.name for word in given)

    def _unknown(self, word: str) -> str:
        import difflib

        near = difflib.get_close_matches(word, list(self._name_of), n=1)
        hint = f", did you mean '{near[0]}'?" if near else ""
        return f"unknown option '{word}'{hint}; see holba.options()"


_cache: Dict[str, OptionTable] = {}


def command_table(command: str) -> OptionTable:
    """The options of a command of the program. Raises InputError if there is no such command."""
    key = "command " + command
    if key not in _cache:
        _cache[key] = OptionTable(lambda: _core.CommandRun(command))
    return _cache[key]


def table(function: str) -> OptionTable:
    """The options of a function of this package. Raises InputError for a name that has none."""
    if function not in _TABLES:
        return command_table(function)
    if function not in _cache:
        _cache[function] = OptionTable(_TABLES[function])
    return _cache[function]


def options(function: str) -> List[Option]:
    """The options of a function ("adjust", "refine", ...), in the order of the program's help.

    Raises InputError for a function without options.
    """
    return list(table(function).options)


def commands() -> Dict[str, str]:
    """Names of the program's commands, each of which holba.run runs, with a sentence about it."""
    return {name: _core.CommandRun(name).summary for name in _core.command_names()}


def text_of(function: str) -> str:
    """The options as the end of a docstring."""
    lines = []
    for option in options(function):
        kind = "|".join(option.choices) if option.choices else option.type
        extent = f", {option.range}" if option.range else ""
        lines.append(f"    {option.keyword}: {kind}{extent}, default {option.default!r}. {option.sentence}")
    return "\n".join(lines)


def document(functions: Mapping[str, Any]) -> None:
    """Puts the options of functions behind the last words of their docstrings, "Options (keywords):"."""
    marker = "Options (keywords):"
    for name, function in functions.items():
        if getattr(function, "__doc__", None) and function.__doc__.rstrip().endswith(marker):
            function.__doc__ = f"{function.__doc__.rstrip()}\n{text_of(name)}\n"
