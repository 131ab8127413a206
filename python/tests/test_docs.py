# SPDX-License-Identifier: BSD-3-Clause
"""The Python of the documentation runs."""

import os
import pathlib
import re

import holba
import pytest

DOCS = pathlib.Path(__file__).resolve().parents[2]


def blocks(path: pathlib.Path) -> str:
    """All blocks of a page as one program, with the lines where they stand."""
    lines = path.read_text(encoding="utf-8").splitlines()
    out, inside = [], False
    for line in lines:
        if line.strip() == "```python":
            inside = True
            out.append("")
        elif line.strip() == "```":
            inside = False
            out.append("")
        else:
            out.append(line if inside else "")
    return "\n".join(out)


@pytest.mark.parametrize("page", ["docs/python.md", "README.md"])
def test_every_block_runs(page, tmp_path, monkeypatch):
    if not (DOCS / page).exists():
        pytest.skip(f"{page} is not there")
    program = blocks(DOCS / page)
    assert re.search(r"\bholba\.", program)
    monkeypatch.chdir(tmp_path)
    holba.synthesize(output_path="scene", num_images=12, seed=1, vps=True)
    holba.synthesize(database_path="database.db", num_images=20, seed=2, scene="sphere")
    os.makedirs("sparse")
    holba.read_model("scene/perturbed").write("sparse/0")
    exec(compile(program, page, "exec"), {"__name__": "docs"})
