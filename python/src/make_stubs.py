# SPDX-License-Identifier: BSD-3-Clause
"""Writes _core.pyi: the types of the native module, as nanobind tells them.

make_stubs.py FOLDER_OF_THE_PACKAGE OUTPUT. What nanobind says less exactly than mypy wants to know is completed.
"""

import re
import subprocess
import sys

folder, output = sys.argv[1:]
subprocess.run(
    [sys.executable, "-m", "nanobind.stubgen", "-q", "-m", "holba._core", "-i", folder, "-o", output, "-P"], check=True
)
with open(output, encoding="utf-8") as file:
    text = file.read()
text = re.sub(r"os\.PathLike(?!\[)", "os.PathLike[str]", text)
text = re.sub(r"\btuple(?![\[\w(])", "tuple[object, ...]", text)
# Pickles: files by name.
text = re.sub(r"\bdict(?![\[\w(])", "dict[str, bytes]", text)
if "__version__" not in text:
    text += "\n__version__: str = ...\n"
with open(output, "w", encoding="utf-8") as file:
    file.write(text)
