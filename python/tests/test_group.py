# SPDX-License-Identifier: BSD-3-Clause
"""Groups whose projection is written in Python, and group types that the library has beyond the paper's."""

import importlib.util
import pathlib

import holba
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

ROOT = pathlib.Path(__file__).resolve().parents[2]

OPTIONS = {"config": "point", "point_loss": "trivial", "refine_focal_length": False}


def plane(X, g):
    """[nx ny nz w] on a plane."""
    n = g[:, :3] / np.linalg.norm(g[:, :3], axis=1, keepdims=True)
    return X - (np.sum(n * X, axis=1, keepdims=True) + g[:, 3:]) * n


def sphere(X, g):
    u = X - g[:, :3]
    return g[:, :3] + np.exp(g[:, 3:]) * u / np.linalg.norm(u, axis=1, keepdims=True)


def sphere_jacobian(X, g):
    u = X - g[:, :3]
    distance = np.linalg.norm(u, axis=1)[:, None, None]
    u = u / distance[:, :, 0]
    r = np.exp(g[:, 3:])[:, :, None]
    by_point = r / distance * (np.eye(3) - u[:, :, None] * u[:, None, :])
    return [by_point, np.concatenate([np.eye(3) - by_point, r * u[:, :, None]], axis=2)]


def start(scene):
    model = holba.read_model(scene / "perturbed")
    group_id, group = next((i, g) for i, g in model.groups3D.items() if g.type == "SPHERE")
    return model, group_id, np.array([*group.params[:3], np.log(group.params[3])]), list(group.point3D_ids)


def cost_of(problem, term):
    return sum(t.cost for t in problem.terms() if t.term == term)


@pytest.fixture()
def spheres(scene):
    """A model without structure and with one sphere, and the sphere."""
    return start(scene)


def native_result(scene, weight):
    """The sphere by the library's own type: all other groups take no part."""
    model, group_id, _, _ = start(scene)
    selection = holba.select_all(model)
    holba.drop(selection, model, groups=[i for i in model.groups3D if i != group_id])
    problem = holba.build_problem(model, selection=selection, **{**OPTIONS, "config": "groups"}, group_loss="trivial",
                                  group_weight=weight, line_weight=0.0)
    return problem, problem.group_blocks[group_id]


@pytest.mark.parametrize("jacobian", [None, sphere_jacobian])
def test_a_sphere_in_python_has_the_residuals_and_jacobians_of_the_native_one(scene, spheres, jacobian):
    model, group_id, values, points = spheres
    native, native_block = native_result(scene, 0.5)
    problem = holba.build_problem(model, **OPTIONS)
    block = problem.add_group("ball", values, points, sphere, jacobian=jacobian, weight=0.5)
    assert_allclose(problem.values(block), native.values(native_block), atol=1e-14)
    theirs = [b["term"] for b in native.batches].index("group_point")
    mine = [b["term"] for b in problem.batches].index("ball")
    (r, present), (r_native, _) = problem.residuals(mine), native.residuals(theirs)
    assert present.all()
    order, order_native = np.lexsort(r.T), np.lexsort(r_native.T)
    assert_allclose(r[order], r_native[order_native], atol=1e-9)
    assert cost_of(problem, "ball") == pytest.approx(cost_of(native, "group_point"), rel=1e-9)


@pytest.mark.parametrize("jacobian", [None, sphere_jacobian])
def test_the_native_solver_takes_it_down_as_its_own(scene, spheres, jacobian):
    model, group_id, values, points = spheres
    problem = holba.build_problem(model, **OPTIONS)
    block = problem.add_group("ball", values, points, sphere, jacobian=jacobian)
    summary = holba.solve(problem, num_threads=1)
    assert summary.final_cost < 0.5 * summary.initial_cost
    again = holba.build_problem(start(scene)[0], **OPTIONS)
    again.add_group("ball", values, points, sphere, jacobian=jacobian)
    assert holba.solve(again, num_threads=2).final_cost == summary.final_cost
    # The truth's sphere has this radius.
    truth = holba.read_model(scene / "truth").groups3D[group_id].params
    assert np.exp(problem.values(block)[3]) == pytest.approx(truth[3], rel=0.1)


def test_given_and_numeric_derivatives_agree(spheres):
    model, _, values, points = spheres
    made = []
    for jacobian in (None, sphere_jacobian):
        problem = holba.build_problem(model, **OPTIONS)
        problem.add_group("ball", values, points, sphere, jacobian=jacobian)
        made.append(holba.jacobian(problem)[0].toarray())
    assert_allclose(made[0], made[1], atol=1e-5 * np.abs(made[1]).max())


def test_where_it_is_undefined_the_residual_is_absent(spheres):
    model, _, values, points = spheres
    problem = holba.build_problem(model, **OPTIONS)
    problem.add_group("nothing", values, points, lambda X, g: np.full_like(X, np.nan))
    assert cost_of(problem, "nothing") == 0.0


def test_what_is_wrong_is_said(spheres):
    model, _, values, points = spheres
    problem = holba.build_problem(model, **OPTIONS)
    with pytest.raises(holba.InputError, match="no point 999999999"):
        problem.add_group("ball", values, [999999999], sphere)
    with pytest.raises(holba.InputError, match="manifold"):
        problem.add_group("ball", values, points, sphere, manifold="banana")
    with pytest.raises(ValueError, match="no model"):
        holba.Problem().add_group("ball", values, points, sphere)
    problem.add_group("ball", values, points, lambda X, g: X[:, :2])
    with pytest.raises(ValueError, match="ball"):
        problem.terms()


def load(path):
    spec = importlib.util.spec_from_file_location(path.stem, path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_a_torus_and_a_curve_are_in_models_files_adjustments_and_pages(tmp_path):
    example = load(ROOT / "examples/groups/torus_and_curve.py")
    assert holba.group_types()["TORUS"] == "cx cy cz dx dy dz R r"
    truth, model, (torus, curve) = example.make_scene(tmp_path / "scene")
    model.write(tmp_path / "txt", output_type="txt")
    assert_array_equal(holba.read_model(tmp_path / "txt").groups3D[torus].params, model.groups3D[torus].params)
    summary = holba.adjust(model)
    assert any(t.term == "group_point" and t.residuals > 1000 for t in summary.final_terms.values())
    model.transform(holba.align(model, truth))
    # Twelve photographs with 1 px of noise tell a radius to a few thousandths of a unit.
    assert_allclose(model.groups3D[torus].params[-2:], example.TORUS[-2:], atol=0.02)
    for group in (torus, curve):
        assert len(model.groups3D[group].point3D_ids) == 60
        assert example.distance_from_truth(model, truth, group) < 0.02
    assert len(example.surfaces(model, tmp_path)) > 3000
    assert len(model.show().page) > 100_000
    example.draw(model, [torus, curve], tmp_path, tmp_path / "groups.svg")
    assert (tmp_path / "groups.svg").read_text().count("<circle") == 120
