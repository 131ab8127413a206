# SPDX-License-Identifier: BSD-3-Clause
"""Adjustment of models in memory, and what it leaves to say about them."""

from __future__ import annotations

from typing import Any, Callable, Dict, List, Optional, Sequence, Tuple

from typing_extensions import Unpack

from . import _core, _options
from ._core import (
    AdjustSummary,
    BundleSelection,
    IterationRecord,
    ModelUncertainty,
    Reconstruction,
    SolverSummary,
    SolverWorkspace,
    TermCost,
)
from ._keywords import AdjustKeywords
from ._types import ArrayLike

# Called after every iteration; False ends the adjustment there, an exception does, too.
Callback = Callable[[IterationRecord], Optional[bool]]
# Image id, group id, direction (3,) in the camera's frame, its standard deviation in degrees.
Measurement = Tuple[int, int, ArrayLike, float]


def adjust(
    model: Reconstruction,
    *,
    selection: Optional[BundleSelection] = None,
    measurements: Sequence[Measurement] = (),
    on_iteration: Optional[Callback] = None,
    **options: Unpack[AdjustKeywords],
) -> AdjustSummary:
    """Adjusts cameras, points, lines, groups and wireframe of a model together, in place.

    The same as `holba adjust` (docs/adjust.md): rounds of robust losses whose scales are measured, tests of
    associations, weights chosen by points left out.

    selection: the part that takes part (select_all, select_around); None: the whole model.
    measurements: (image id, group id, direction (3,) in the camera's frame, sigma in degrees) of groups.
    on_iteration: called with an IterationRecord after every iteration; returning False ends the adjustment.
    Other threads of Python run meanwhile; they must not use the model. Ctrl-C, and an exception of on_iteration,
    end it after the iteration: the model is then that of the last accepted step, and consistent.

    Raises InputError for options, and for a model of which nothing can be adjusted. Options (keywords):
    """
    made = _options.table("adjust").bind(options)
    return _core._adjust(model, made, selection, measurements, on_iteration)


def adjust_local(
    model: Reconstruction,
    selection: BundleSelection,
    *,
    workspace: Optional[SolverWorkspace] = None,
    on_iteration: Optional[Callback] = None,
    **options: Unpack[AdjustKeywords],
) -> SolverSummary:
    """Adjusts a part of a model once, at the cost of the part: what a mapper does after each image.

    There are no rounds: a loss "auto" is Cauchy at its settings' scale, the default is trivial, associations are not
    tested. workspace: carries memory from call to call. Else as adjust.
    """
    made = _options.table("adjust").bind(options)
    return _core._adjust_local(model, selection, made, workspace, on_iteration)


def select_all(model: Reconstruction, **options: Unpack[AdjustKeywords]) -> BundleSelection:
    """The whole model, with what the options hold. The model must be consistent."""
    return _core._select_all(model, _options.table("adjust").bind(options))


def select_around(
    model: Reconstruction,
    image_ids: Sequence[int],
    *,
    surroundings: bool = True,
    hold_intrinsics: bool = True,
    **options: Unpack[AdjustKeywords],
) -> BundleSelection:
    """The frames of images with the points and lines that at least two of them see.

    surroundings: frames that see the same from outside take part, held. hold_intrinsics: intrinsics and poses of
    sensors in their rigs stay. Costs what the part costs. Raises KeyError for an image without a pose.
    """
    made = _options.table("adjust").bind(options)
    return _core._select_around(model, list(image_ids), surroundings, hold_intrinsics, made)


def hold(
    selection: BundleSelection,
    model: Reconstruction,
    *,
    frames: Sequence[int] = (),
    cameras: Sequence[int] = (),
    points: Sequence[int] = (),
    lines: Sequence[int] = (),
    groups: Sequence[int] = (),
    **options: Unpack[AdjustKeywords],
) -> None:
    """Holds records of a selection by their ids; what they do not fix of the gauge is fixed as before."""
    _change("_hold", selection, model, options, frames=frames, cameras=cameras, points=points, lines=lines, groups=groups)


def drop(
    selection: BundleSelection,
    model: Reconstruction,
    *,
    points: Sequence[int] = (),
    lines: Sequence[int] = (),
    groups: Sequence[int] = (),
    **options: Unpack[AdjustKeywords],
) -> None:
    """Takes records out of a selection: they stay as they are and have no say."""
    _change("_drop", selection, model, options, points=points, lines=lines, groups=groups)


def _change(
    verb: str, selection: BundleSelection, model: Reconstruction, options: Any, **records: Sequence[int]
) -> None:
    made = _options.table("adjust").bind(options)
    for what, ids in records.items():
        if len(ids) > 0:
            getattr(selection, verb)(model, made, what, [int(i) for i in ids])


def covariances(
    model: Reconstruction, summary: AdjustSummary, **options: Unpack[AdjustKeywords]
) -> Optional[ModelUncertainty]:
    """Covariances of poses, points, lines and groups as an adjustment left them.

    summary, options: of that adjustment. None: the system is singular.
    """
    return _core._covariances(model, summary, _options.table("adjust").bind(options))


def evaluate(model: Reconstruction) -> Dict[str, TermCost]:
    """Residuals of every term of docs/FORMAT.md at the model as it stands, before weights and losses."""
    terms: List[TermCost] = _core._evaluate(model)
    return {term.term: term for term in terms}
