# SPDX-License-Identifier: BSD-3-Clause
"""The stubs: right programs pass mypy, wrong ones do not, and nothing public is without a type."""

import os
import pathlib
import subprocess
import sys

import holba
import pytest

pytest.importorskip("mypy", reason="mypy is not installed")

RIGHT = """
import numpy as np
import holba

model = holba.read_model("x")
summary = holba.adjust(model, config="point", max_num_iterations=3, on_iteration=lambda r: r.cost > 1)
cost: float = summary.final_cost
xyz = model.points3D.xyz(copy=False)
xyz[0] = 1.0
for point_id, point in model.points3D.items():
    n: int = point_id
    model.delete_point3D(point.id)
pose = model.images[1].cam_from_world
if pose is not None:
    model.register_image(1, pose * holba.Rigid3d(np.eye(3), [0, 0, 0]))
camera: holba.Camera = model.cameras[1]
problem = holba.build_problem(model, gauge="free")
problem.add_residuals("r", 1, lambda x: x, np.array([[0]], dtype=np.uint32))
refined, report = holba.refine(model, "images", num_threads=2)
refined.write("y")
mapper = holba.Mapper("database.db", structure="lines")
ok: bool = mapper.register_image(3).accepted
"""

WRONG = [
    ('holba.adjust(model, config="points")', "config"),
    ("holba.adjust(model, max_num_iterations='3')", "max_num_iterations"),
    ("holba.adjust(model, max_iterations=3)", "max_iterations"),
    ("model.points3D['a']", "index"),
    ("model.add_point3D(1)", "add_point3D"),
    ("x: str = holba.read_model('a')", "Reconstruction"),
]


def mypy(path: pathlib.Path, *options: str) -> "subprocess.CompletedProcess[str]":
    root = pathlib.Path(holba.__file__).parent.parent
    environment = dict(os.environ, MYPYPATH=str(root), PYTHONPATH="")
    return subprocess.run(
        [sys.executable, "-m", "mypy", "--strict", "--cache-dir", str(path.parent / "cache"), *options, str(path)],
        capture_output=True, text=True, env=environment, cwd=path.parent, check=False,
    )


def test_the_package_is_typed_and_right_programs_pass(tmp_path):
    program = tmp_path / "right.py"
    program.write_text(RIGHT)
    result = mypy(program)
    assert result.returncode == 0, result.stdout


def test_wrong_programs_are_found(tmp_path):
    program = tmp_path / "wrong.py"
    begin = 'import holba\nmodel = holba.read_model("x")\n'
    program.write_text(begin + "".join(line + "\n" for line, _ in WRONG))
    result = mypy(program)
    for i, (line, word) in enumerate(WRONG):
        found = [out for out in result.stdout.splitlines() if out.startswith(f"wrong.py:{i + 3}:")]
        assert found and word in "".join(found), (line, result.stdout)


def test_the_stubs_name_what_the_module_has():
    stub = (pathlib.Path(holba.__file__).parent / "_core.pyi").read_text()
    for name in dir(holba._core):
        if not name.startswith("__"):
            assert f" {name}" in stub or stub.startswith(name) or f"\n{name}" in stub, name
