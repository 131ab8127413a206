# SPDX-License-Identifier: BSD-3-Clause
"""The Python of the documentation runs."""

import os
import pathlib
import re
import subprocess
import sys

import holba
import pytest

DOCS = pathlib.Path(__file__).resolve().parents[2]


def blocks(path: pathlib.Path) -> str:
    """All blocks of a page as one program, with the lines where they stand. Those of a file are run as that file."""
    lines = path.read_text(encoding="utf-8").splitlines()
    out, inside, mark = [], False, ""
    for line in lines:
        if line.startswith("<!-- test: "):
            mark = line
            out.append("")
        elif line.strip() == "```python" and "test: file" not in mark:
            inside = True
            out.append("")
        elif line.strip().startswith("```"):
            inside, mark = False, mark if line.strip() == "```python" else ""
            out.append("")
        else:
            out.append(line if inside else "")
    return "\n".join(out)


PAGES = sorted(
    str(page.relative_to(DOCS))
    for page in [DOCS / "README.md", *DOCS.glob("docs/**/*.md")]
    if page.exists() and blocks(page).strip()
)


@pytest.mark.parametrize("page", PAGES)
def test_every_block_runs(page, tmp_path, monkeypatch):
    program = blocks(DOCS / page)
    assert re.search(r"\bholba\.", program)
    monkeypatch.chdir(tmp_path)
    holba.synthesize(output_path="scene", num_images=12, seed=1, vps=True)
    holba.synthesize(database_path="database.db", num_images=20, seed=2, scene="sphere")
    os.makedirs("sparse")
    holba.read_model("scene/perturbed").write("sparse/0")
    exec(compile(program, page, "exec"), {"__name__": "docs"})


def test_the_pages_with_python_are_found():
    assert {"README.md", "docs/python.md", "docs/quick_start.md", "docs/extend/residual.md"} <= set(PAGES)


def test_the_script_beside_those_of_other_libraries_runs(scene):
    script = DOCS / "examples/compare/with_holba.py"
    result = subprocess.run(
        [sys.executable, script, scene / "perturbed", scene / "truth"], capture_output=True, text=True, check=True
    )
    assert re.search(r"AUC @0\.5: [0-9.]+ @1: [0-9.]+ @3: [0-9.]+", result.stdout)
