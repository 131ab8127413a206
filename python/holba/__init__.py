# SPDX-License-Identifier: BSD-3-Clause
"""holba: holistic bundle adjustment of cameras, points, lines and the structures that tie them together.

    import holba
    model = holba.read_model("sparse/0")
    summary = holba.adjust(model, refine_principal_point=True)
    model.write("adjusted")

Functions have the names of the program's commands and their options as keywords (docs/python.md).
Conventions are COLMAP's: poses are cam_from_world, the centre of the top left pixel is at (0.5, 0.5).
Messages go to the logger "holba" of Python's logging.
"""

import atexit as _atexit
import logging as _logging

from . import _core, _options
from ._core import (
    NO_ID,
    AdjustSummary,
    BundleSelection,
    Camera,
    Covariance,
    Frame,
    Group3D,
    GroundTruthErrors,
    Image,
    IterationRecord,
    Line3D,
    ModelUncertainty,
    Point3D,
    PoseErrors,
    Problem,
    Reconstruction,
    Rig,
    Rigid3d,
    Sim3d,
    SolverSummary,
    SolverWorkspace,
    TermCost,
    __version__,
    align,
    camera_models,
    compare_poses,
    compare_to_truth,
    estimate_similarity,
    group_types,
    read_model,
    read_poses,
    update_errors,
)
from ._adjust import (
    adjust,
    adjust_local,
    covariances,
    drop,
    evaluate,
    hold,
    select_all,
    select_around,
)
from ._commands import (
    bench,
    convert,
    evaluate_poses,
    extract,
    inspect,
    localize,
    map,
    match,
    reconstruct,
    refine,
    render,
    run,
    synthesize,
    transform,
    view,
)
from ._errors import CheckError, Error, InputError
from ._mapper import Mapper
from ._options import Option, commands, options
from ._problem import build_problem, columns, jacobian, reduced_system, solve
from ._pycolmap import from_pycolmap, to_pycolmap
from ._show import View, show

_logger = _logging.getLogger("holba")
_core._set_logger(_logger.log)

# At the end of the interpreter messages of threads that are still at work have nowhere to go.
_atexit.register(_core._set_logger, None)

_options.document(globals())

__all__ = [
    "NO_ID",
    "AdjustSummary",
    "BundleSelection",
    "Camera",
    "CheckError",
    "Covariance",
    "Error",
    "Frame",
    "GroundTruthErrors",
    "Group3D",
    "Image",
    "InputError",
    "IterationRecord",
    "Line3D",
    "Mapper",
    "ModelUncertainty",
    "Option",
    "Point3D",
    "PoseErrors",
    "Problem",
    "Reconstruction",
    "Rig",
    "Rigid3d",
    "Sim3d",
    "SolverSummary",
    "SolverWorkspace",
    "TermCost",
    "View",
    "__version__",
    "adjust",
    "adjust_local",
    "align",
    "bench",
    "build_problem",
    "camera_models",
    "columns",
    "commands",
    "compare_poses",
    "compare_to_truth",
    "convert",
    "covariances",
    "drop",
    "estimate_similarity",
    "evaluate",
    "evaluate_poses",
    "extract",
    "from_pycolmap",
    "group_types",
    "hold",
    "inspect",
    "jacobian",
    "localize",
    "map",
    "match",
    "options",
    "read_model",
    "read_poses",
    "reconstruct",
    "reduced_system",
    "refine",
    "render",
    "run",
    "select_all",
    "select_around",
    "show",
    "solve",
    "synthesize",
    "to_pycolmap",
    "transform",
    "update_errors",
    "view",
]
