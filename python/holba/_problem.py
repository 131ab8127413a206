# SPDX-License-Identifier: BSD-3-Clause
"""Problems as arrays and sparse matrices, and their solution."""

from __future__ import annotations

from typing import TYPE_CHECKING, Optional, Tuple

import numpy as np
import numpy.typing as npt
from typing_extensions import Unpack

from . import _core, _options
from ._adjust import Callback
from ._core import BundleSelection, Problem, Reconstruction, SolverSummary, SolverWorkspace
from ._keywords import AdjustKeywords, SolveKeywords

if TYPE_CHECKING:
    import scipy.sparse  # type: ignore[import-untyped, unused-ignore]


def build_problem(
    model: Reconstruction,
    *,
    selection: Optional[BundleSelection] = None,
    **options: Unpack[AdjustKeywords],
) -> Problem:
    """The least-squares problem of one adjustment of a model, with its values as they stand.

    Blocks are poses [qx qy qz qw tx ty tz], intrinsics, points, lines [d p] and groups (positive quantities as
    logarithms). Losses "auto" are Cauchy at their settings' scale; associations are not tested. Residuals of one's own
    are added by Problem.add_residuals; solve solves it, Problem.write_back puts the values into the model.
    """
    return _core._build_problem(model, _options.table("adjust").bind(options), selection)


def solve(
    problem: Problem,
    *,
    workspace: Optional[SolverWorkspace] = None,
    on_iteration: Optional[Callback] = None,
    **options: Unpack[SolveKeywords],
) -> SolverSummary:
    """Minimises the cost of a problem from its state on, and leaves the best state found there.

    on_iteration, Ctrl-C: as for adjust. Raises InputError, and what a residual written in Python raises: the state is
    then that of the last accepted step. Options (keywords):
    """
    return problem._solve(_options.table("solve").bind(options), workspace, on_iteration)


def jacobian(problem: Problem) -> Tuple["scipy.sparse.csr_array", npt.NDArray[np.float64]]:
    """The Jacobian of all weighted, robustified residuals (CSR), and these residuals (m,).

    Rows: batch by batch, residual by residual; columns: the variable tangent coordinates, block by block
    (columns tells where a block begins). Both times sqrt(weight * rho'): J^T r is the gradient of the cost. Needs scipy.
    """
    import scipy.sparse  # type: ignore[import-untyped, unused-ignore]

    values, rows, cols, residuals, count = problem._jacobian()
    return scipy.sparse.csr_array((values, (rows, cols)), shape=(len(residuals), count)), residuals


def columns(problem: Problem) -> npt.NDArray[np.int64]:
    """(num_blocks,) first column of each block in jacobian(problem); -1: the block is held."""
    first, _ = problem._columns()
    return first


def reduced_system(
    problem: Problem, *, num_threads: int = -1
) -> Tuple["scipy.sparse.csc_array", npt.NDArray[np.float64], npt.NDArray[np.int64]]:
    """The system S x = b of the kept unknowns after the features are eliminated, undamped, as the native solver has it.

    Returns S (CSC, n x n, symmetric), b (n,), and (n, 2) block and tangent coordinate of each unknown. A coordinate
    that is held in some blocks of its kind only has a row of zeros. Needs scipy.
    """
    import scipy.sparse  # type: ignore[import-untyped, unused-ignore]

    values, rows, cols, rhs, block, coordinate = problem._reduced_system(num_threads)
    S = scipy.sparse.csc_array((values, (rows, cols)), shape=(len(rhs), len(rhs)))
    return S, rhs, np.stack([block.astype(np.int64), coordinate.astype(np.int64)], axis=1)
