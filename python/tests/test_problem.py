# SPDX-License-Identifier: BSD-3-Clause
"""Problems as arrays, and residuals written in Python."""

import holba
import numpy as np
import pytest
import scipy.sparse
from numpy.testing import assert_allclose, assert_array_equal

POINT_ONLY = {"config": "point", "point_loss": "trivial", "refine_focal_length": False}


def rotate(quats, X):
    """Rows of X turned by rows of quaternions [x y z w]."""
    q, w = quats[:, :3], quats[:, 3:]
    n = np.sum(quats**2, axis=1, keepdims=True)
    return ((w * w - np.sum(q * q, axis=1, keepdims=True)) * X + 2 * q * np.sum(q * X, axis=1, keepdims=True)
            + 2 * w * np.cross(q, X)) / n


@pytest.fixture()
def near(scene):
    """A little off the truth, so that every residual is defined."""
    model = holba.read_model(scene / "truth")
    rng = np.random.default_rng(3)
    model.points3D.xyz(copy=False)[:] += rng.normal(scale=0.02, size=(len(model.points3D), 3))
    return model


def own_problem(model, jacobian, loss="trivial"):
    """The points of a model by a residual in Python: blocks of poses, points and, constant, of observed pixels."""
    table = model.point_observations()
    f, cx, cy = next(iter(model.cameras.values())).params
    native = holba.build_problem(model, **POINT_ONLY)
    problem = holba.build_problem(model, **POINT_ONLY, point_weight=0.0)
    pose_of = {i: native.pose_blocks[image.frame_id] for i, image in model.images.items()}
    rows = []
    for point_id, image_id, xy in zip(table["point3D_id"], table["image_id"], table["xy"]):
        if int(point_id) in problem.point_blocks:
            rows.append((problem.point_blocks[int(point_id)], pose_of[int(image_id)],
                         problem.add_block("pixel", xy, constant=True)))

    def values(X, pose, xy):
        Y = rotate(pose[:, :4], X) + pose[:, 4:]
        return np.where(Y[:, 2:] > 0, f * Y[:, :2] / Y[:, 2:] + [cx, cy] - xy, np.nan)

    def derivatives(X, pose, xy):
        RX = rotate(pose[:, :4], X)
        Y = RX + pose[:, 4:]
        n = len(X)
        d = np.zeros((n, 2, 3))
        d[:, 0, 0] = d[:, 1, 1] = f / Y[:, 2]
        d[:, :, 2] = -f * Y[:, :2] / Y[:, 2:] ** 2
        R = np.stack([rotate(pose[:, :4], np.tile(e, (n, 1))) for e in np.eye(3)], axis=2)
        cross = np.zeros((n, 3, 3))  # d(exp(w) RX)/dw = -[RX]x
        for a, b, c in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
            cross[:, b, c], cross[:, c, b] = RX[:, a], -RX[:, a]
        return [d @ R, np.concatenate([d @ cross, d], axis=2), np.tile(-np.eye(2), (n, 1, 1))]

    problem.add_residuals("mine", 2, values, np.array(rows), jacobian=derivatives if jacobian else None, loss=loss)
    return native, problem


def batch_of(problem, term):
    return next(i for i, b in enumerate(problem.batches) if b["term"] == term)


def test_the_state_is_shown_and_written_without_a_copy(model):
    problem = holba.build_problem(model, config="point")
    point_id, block = next(iter(problem.point_blocks.items()))
    values, state = problem.values(block), problem.state
    assert_array_equal(values, model.points3D[point_id].xyz)
    values[:] = [1, 2, 3]
    assert any((state[i : i + 3] == [1, 2, 3]).all() for i in range(len(state) - 2))
    with pytest.raises(BufferError):
        problem.add_block("x", [1.0])
    problem.write_back()
    assert_array_equal(model.points3D[point_id].xyz, [1, 2, 3])


def test_residuals_are_those_of_the_formula_and_jacobians_their_derivatives(near):
    problem = holba.build_problem(near, **POINT_ONLY)
    batch = batch_of(problem, "point")
    residuals, present = problem.residuals(batch)
    assert present.all() and residuals.shape == (problem.batches[batch]["size"], 2)
    assert_allclose(np.sum(residuals**2), problem.terms()[0].sum_squares, rtol=1e-12)
    # By central differences of the state, through the order of the numbers in the blocks.
    blocks = problem.blocks_of(batch)
    jacobians = problem.jacobians(batch)
    for slot, size in ((0, 3),):
        for k in range(size):
            x = problem.values(int(blocks[7, slot]))
            h = 1e-6
            x[k] += h
            plus = problem.residuals(batch)[0][7].copy()
            x[k] -= 2 * h
            minus = problem.residuals(batch)[0][7].copy()
            x[k] += h
            assert_allclose(jacobians[slot][7][:, k], (plus - minus) / (2 * h), rtol=1e-5, atol=1e-4)


def test_the_sparse_jacobian_gives_the_gradient_of_the_cost(near):
    problem = holba.build_problem(near, config="holistic")
    J, r = holba.jacobian(problem)
    first = holba.columns(problem)
    gradient = J.T @ r

    def cost():
        return sum(t.cost for t in problem.terms())

    for point_id in list(problem.point_blocks)[:3]:
        block = problem.point_blocks[point_id]
        x = problem.values(block)
        for k in range(3):
            h = 1e-5
            x[k] += h
            plus = cost()
            x[k] -= 2 * h
            minus = cost()
            x[k] += h
            assert_allclose(gradient[first[block] + k], (plus - minus) / (2 * h), rtol=1e-4, atol=1e-3)


def test_the_native_reduced_system_is_the_schur_complement_of_the_jacobian(near):
    problem = holba.build_problem(near, config="holistic")
    J, r = holba.jacobian(problem)
    first = holba.columns(problem)
    kept, features = [], []
    for block in range(problem.num_blocks):
        about = problem.block(block)
        if about["free"]:
            (features if about["role"] == "feature" else kept).extend(
                range(first[block], first[block] + about["free"]))
    H = (J.T @ J).toarray()
    g = J.T @ r
    inverse = np.linalg.inv(H[np.ix_(features, features)])
    expected = H[np.ix_(kept, kept)] - H[np.ix_(kept, features)] @ inverse @ H[np.ix_(features, kept)]
    rhs = -g[kept] + H[np.ix_(kept, features)] @ inverse @ g[features]
    S, b, unknowns = holba.reduced_system(problem)
    # Where the unknowns of the native system are among the kept columns.
    column = {}
    for block in range(problem.num_blocks):
        about = problem.block(block)
        if about["free"] and about["role"] != "feature" and about["free"] == about["tangent"]:
            for t in range(about["tangent"]):
                column[(block, t)] = kept.index(first[block] + t)
    rows = [i for i, (block, t) in enumerate(unknowns) if (block, t) in column]
    order = [column[tuple(unknowns[i])] for i in rows]
    assert len(rows) > 50
    scale = np.abs(expected).max()
    assert_allclose(S.toarray()[np.ix_(rows, rows)], expected[np.ix_(order, order)], atol=1e-9 * scale)
    assert_allclose(b[rows], rhs[order], atol=1e-9 * np.abs(rhs).max())


def test_covariances_are_blocks_of_the_inverse_of_j_transposed_j(near):
    problem = holba.build_problem(near, **POINT_ONLY)
    J, _ = holba.jacobian(problem)
    inverse = np.linalg.inv((J.T @ J).toarray())
    first = holba.columns(problem)
    covariance = problem.covariance()
    for block in [*list(problem.pose_blocks.values())[-3:], *list(problem.point_blocks.values())[:3]]:
        if problem.block(block)["free"] != problem.block(block)["tangent"]:
            continue
        at = slice(first[block], first[block] + problem.block(block)["free"])
        assert_allclose(covariance.of(block), inverse[at, at], rtol=1e-6, atol=1e-9 * np.abs(inverse[at, at]).max())


@pytest.mark.parametrize("with_derivatives", [True, False])
def test_a_residual_in_python_has_the_values_and_derivatives_of_the_native_one(near, with_derivatives):
    native, mine = own_problem(near, with_derivatives)
    a, b = batch_of(native, "point"), batch_of(mine, "mine")
    # Rows in the order of tracks, as the native ones are where there is one camera.
    order_a = np.lexsort(native.blocks_of(a)[:, :2].T)
    order_b = np.lexsort(mine.blocks_of(b)[:, :2].T)
    assert_array_equal(native.blocks_of(a)[order_a][:, 0], mine.blocks_of(b)[order_b][:, 0])
    assert_allclose(native.residuals(a)[0][order_a], mine.residuals(b)[0][order_b], atol=1e-9)
    tolerance = 1e-9 if with_derivatives else 1e-5
    for slot in range(2):
        expected, found = native.jacobians(a)[slot][order_a], mine.jacobians(b)[slot][order_b]
        assert_allclose(found, expected, atol=tolerance * np.abs(expected).max())


@pytest.mark.parametrize("with_derivatives", [True, False])
@pytest.mark.parametrize("num_threads", [1, 2])
def test_a_residual_in_python_comes_to_the_optimum_of_the_native_one(near, with_derivatives, num_threads):
    native, mine = own_problem(near, with_derivatives)
    options = {"num_threads": num_threads, "function_tolerance": 1e-12, "max_num_iterations": 30}
    expected = holba.solve(native, **options)
    found = holba.solve(mine, **options)
    assert expected.stop_reason == "converged"
    assert_allclose(found.final_cost, expected.final_cost, rtol=1e-8)
    for point_id, block in list(native.point_blocks.items())[:20]:
        assert_allclose(mine.values(mine.point_blocks[point_id]), native.values(block), atol=1e-5)


def test_results_with_a_residual_in_python_do_not_depend_on_threads(near):
    states = []
    for num_threads in (1, 2, 3):
        _, mine = own_problem(near, True, loss="cauchy")
        holba.solve(mine, num_threads=num_threads, max_num_iterations=5)
        states.append(mine.state.copy())
    assert_array_equal(states[0], states[1])
    assert_array_equal(states[0], states[2])


def test_a_problem_of_ones_own_finds_the_line_through_points():
    x = np.linspace(-1, 1, 50)
    y = 2.0 * x + 0.5
    problem = holba.Problem()
    line = problem.add_block("line fit", [0.0, 0.0])
    data = [problem.add_block("datum", [a, b], constant=True) for a, b in zip(x, y)]

    def values(p, d):
        return p[:, :1] * d[:, :1] + p[:, 1:] - d[:, 1:]

    problem.add_residuals("fit", 1, values, np.array([(line, d) for d in data]))
    summary = holba.solve(problem, num_threads=1)
    assert_allclose(problem.values(line), [2.0, 0.5], atol=1e-7)
    assert summary.final_cost < 1e-12


def test_rows_with_nan_are_absent():
    problem = holba.Problem()
    block = problem.add_block("x", [2.0])
    data = [problem.add_block("d", [v], constant=True) for v in (1.0, -1.0)]

    def values(x, d):
        return np.where(d > 0, x - d, np.nan)

    problem.add_residuals("half", 1, values, np.array([(block, d) for d in data]))
    (term,) = problem.terms()
    assert (term.residuals, term.absent, term.sum_squares) == (2, 1, 1.0)


def test_faults_of_a_residual_in_python_are_said():
    problem = holba.Problem()
    a, b = problem.add_block("x", [2.0]), problem.add_block("y", [1.0, 2.0])
    with pytest.raises(holba.InputError, match="one kind in each column"):
        problem.add_residuals("r", 1, lambda x: x, np.array([[a], [b]]))
    with pytest.raises(IndexError):
        problem.add_residuals("r", 1, lambda x: x, np.array([[7]]))
    with pytest.raises(holba.InputError, match="cauchy"):
        problem.add_residuals("r", 1, lambda x: x, np.array([[a]]), loss="l1")
    f, g = (problem.add_block("f", [0.0], role="feature") for _ in range(2))
    with pytest.raises(holba.CheckError):
        problem.add_residuals("two features", 1, lambda x, y: x - y, np.array([[f, g]]))
    problem.add_residuals("shape", 1, lambda x: np.zeros((3, 3)), np.array([[a]]))
    with pytest.raises(ValueError, match=r"'shape': expected an array \(1, 1\)"):
        problem.terms()


def test_an_exception_of_a_residual_ends_the_solve_and_comes_out():
    problem = holba.Problem()
    block = problem.add_block("x", [2.0])
    calls = []

    def values(x):
        calls.append(x)
        if len(calls) > 6:
            raise ZeroDivisionError("in the residual")
        return np.exp(x)

    problem.add_residuals("r", 1, values, np.array([[block]]))
    with pytest.raises(ZeroDivisionError, match="in the residual"):
        holba.solve(problem, num_threads=2)
    assert np.isfinite(problem.values(block)).all()


def test_a_prior_in_python_moves_a_point_of_a_model_to_where_it_says(near):
    """A measured position joins the observations: the more it weighs, the nearer the point comes to it."""
    point_id = next(iter(holba.build_problem(near, **POINT_ONLY).point_blocks))
    goal = near.points3D[point_id].xyz + [0.5, 0, 0]
    distances = []
    for weight in (1.0, 1e8):
        problem = holba.build_problem(near, **POINT_ONLY)
        problem.add_residuals("position", 3, lambda X: X - goal, np.array([[problem.point_blocks[point_id]]]),
                              jacobian=lambda X: [np.tile(np.eye(3), (len(X), 1, 1))], weight=weight)
        holba.solve(problem)
        distances.append(np.linalg.norm(problem.values(problem.point_blocks[point_id]) - goal))
    assert distances[1] < 1e-2 < distances[0]


def test_scipy_takes_the_matrices(near):
    J, _ = holba.jacobian(holba.build_problem(near, **POINT_ONLY))
    assert scipy.sparse.issparse(J)
