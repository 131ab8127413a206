# SPDX-License-Identifier: BSD-3-Clause
"""Writes _keywords.py of the package: the options of every function as a class of typed keywords.

make_keywords.py PACKAGE_FOLDER OUTPUT. For type checkers and editors; made from the option tables of the module that
was just built, so that a keyword is declared nowhere else.
"""

import ast
import importlib.util
import os
import sys
import types


def load(folder):
    """The package's option tables without its __init__, which needs what is made here."""
    package = types.ModuleType("holba")
    package.__path__ = [folder]
    sys.modules["holba"] = package
    names = [n for n in os.listdir(folder) if n.startswith("_core.") and n.endswith((".so", ".pyd"))]
    for name, file in (("_core", names[0]), ("_options", "_options.py")):
        spec = importlib.util.spec_from_file_location(f"holba.{name}", os.path.join(folder, file))
        module = importlib.util.module_from_spec(spec)
        sys.modules[f"holba.{name}"] = module
        setattr(package, name, module)
        spec.loader.exec_module(module)
    return package._core, package._options


TYPES = {
    "bool": "bool",
    "int": "int",
    "uint": "int",
    "double": "float",
    "text": "Path",
    "doubles": "Sequence[float]",
}


def parameters_of_functions(path):
    """Names of the parameters that each function has beside its options."""
    with open(path, encoding="utf-8") as file:
        tree = ast.parse(file.read())
    return {
        f.name: {a.arg for a in [*f.args.args, *f.args.kwonlyargs]} for f in tree.body if isinstance(f, ast.FunctionDef)
    }


def type_of(option):
    if option.type == "choice":
        return "Literal[" + ", ".join(repr(c) for c in option.choices) + "]"
    return TYPES[option.type]


def main():
    folder, output = sys.argv[1:]
    core, options = load(folder)
    own = parameters_of_functions(os.path.join(folder, "_commands.py"))
    lines = [
        "# SPDX-License-Identifier: BSD-3-Clause",
        '"""The options of every function as typed keywords. Made by make_keywords.py."""',
        "",
        "from typing import Literal, Sequence, TypedDict",
        "",
        "from ._types import Path",
    ]
    for function in sorted({*core.command_names(), *options._TABLES}):
        lines += ["", "", f"class {''.join(w.title() for w in function.split('_'))}Keywords(TypedDict, total=False):"]
        lines += [f'    """Options of holba.{function}; holba.options("{function}") tells their ranges."""', ""]
        for option in options.options(function):
            if option.keyword not in own.get(function, ()):
                lines.append(f"    {option.keyword}: {type_of(option)}")
    with open(output, "w", encoding="utf-8") as file:
        file.write("\n".join(lines) + "\n")


main()
