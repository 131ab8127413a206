# SPDX-License-Identifier: BSD-3-Clause
"""Hooks of mkdocs (mkdocs.yml): pages that are made, and links to files that are no pages.

Every option of every command is a page made of the program's option tables (`holba COMMAND --help json`), the
reference of the Python package one made of its stubs. Links from a page to a file outside of docs/ go to the repository.
"""

import ast
import json
import os
import pathlib
import posixpath
import re
import subprocess

from mkdocs.structure.files import File

ROOT = pathlib.Path(__file__).resolve().parent.parent
REPOSITORY = os.environ.get("HOLBA_REPOSITORY_URL", "https://github.com/holba/holba/blob/main")


def program():
    path = pathlib.Path(os.environ.get("HOLBA", ROOT / "build/bin/holba"))
    return path if path.exists() else None


def commands(holba):
    text = subprocess.run([holba, "--help"], check=True, capture_output=True, text=True).stdout
    return re.findall(r"^  ([a-z_]+)  +\S", text, re.MULTILINE)


def options_page(holba, command):
    """A section of an option table for each command: name, type, default, range, sentence."""
    described = json.loads(
        subprocess.run([holba, command, "--help", "json"], check=True, capture_output=True, text=True).stdout
    )
    lines = [f"# holba {command}", "", f"{described['summary']}.", "", described.get("details", ""), ""]
    lines += ["| option | type | default | |", "| --- | --- | --- | --- |"]
    for option in described["options"]:
        kind = ", ".join(option["choices"]) if "choices" in option else option["type"]
        default = "required" if option["required"] else f"`{json.dumps(option['default'])}`"
        allowed = range_words(option["range"]) if option.get("range") else ""
        text = (option["sentence"] + allowed).replace("|", "\\|").replace("<", "&lt;")
        lines.append(f"| `--{option['name']}` | {kind} | {default} | {text} |")
    return "\n".join(lines) + "\n"


def range_words(limits):
    """What the table says of a number, as the program's help says it."""
    words = []
    if limits["low"] is not None:
        words.append(f"{'greater than' if limits['low_is_open'] else 'at least'} {limits['low']:g}")
    if limits["high"] is not None:
        words.append(f"{'less than' if limits['high_is_open'] else 'at most'} {limits['high']:g}")
    return f" ({', '.join(words)})" if words else ""


def docstring(node):
    return (ast.get_docstring(node) or "").replace("<", "&lt;")


def python_page(package):
    """Functions and classes of the package with signatures and docstrings, of what __init__ exports."""
    exported = set()
    for node in ast.walk(ast.parse((package / "__init__.py").read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.level == 1:
            exported |= {alias.asname or alias.name for alias in node.names}
    lines = ["# Python reference", "", "Made from the package's stubs. `help(holba.NAME)` lists a function's options, too.", ""]
    found = {}
    for file in sorted([*package.glob("*.py"), package / "_core.pyi"]):
        for node in ast.parse(file.read_text(encoding="utf-8")).body:
            if isinstance(node, (ast.FunctionDef, ast.ClassDef)) and node.name in exported:
                found.setdefault(node.name, node)
    for name in sorted(found, key=str.lower):
        node = found[name]
        lines += [f"## {name}", ""]
        if isinstance(node, ast.FunctionDef):
            lines += [f"```\n{signature(node)}\n```", "", docstring(node), ""]
            continue
        lines += [docstring(node), ""]
        for member in node.body:
            if isinstance(member, ast.FunctionDef) and not member.name.startswith("_"):
                text = " ".join(docstring(member).split())
                lines += [f"- `{signature(member)}`" + (f": {text}" if text else "")]
        lines.append("")
    return "\n".join(lines) + "\n"


def signature(node):
    returns = f" -> {ast.unparse(node.returns)}" if node.returns else ""
    return f"{node.name}({ast.unparse(node.args)}){returns}"


def on_config(config):
    """The pages that are made join the navigation."""
    holba, package = program(), package_folder()
    if holba:
        config.nav.append({"Every option": [{c: f"options/{c}.md"} for c in commands(holba)]})
    if package:
        for section in config.nav:
            if isinstance(section, dict) and "Python" in section:
                section["Python"].append({"Reference": "python_reference.md"})
    return config


def package_folder():
    path = pathlib.Path(os.environ.get("HOLBA_PYTHON_PACKAGE", ROOT / "build/python/holba"))
    return path if (path / "_core.pyi").exists() else None


def on_files(files, config):
    holba, package = program(), package_folder()
    if holba:
        for command in commands(holba):
            files.append(File.generated(config, f"options/{command}.md", content=options_page(holba, command)))
    if package:
        files.append(File.generated(config, "python_reference.md", content=python_page(package)))
    return files


def on_page_markdown(markdown, page, config, files):
    """Relative links that leave docs/ point to the repository."""

    def moved(match):
        target, anchor = match.group(2), match.group(3) or ""
        path = posixpath.normpath(posixpath.join("docs", posixpath.dirname(page.file.src_uri), target))
        if "://" in target or target.startswith("#") or path.startswith("docs/"):
            return match.group(0)
        return f"{match.group(1)}({REPOSITORY}/{path}{anchor})"

    return re.sub(r"(\[[^\]]*\])\(([^)#\s]+)(#[^)\s]*)?\)", moved, markdown)
