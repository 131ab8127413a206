# SPDX-License-Identifier: BSD-3-Clause
"""Types of arguments."""

from __future__ import annotations

import os
from typing import Any, Dict, Sequence, Union

import numpy as np
import numpy.typing as npt

ArrayLike = Union[Sequence[float], npt.NDArray[Any]]
Path = Union[str, "os.PathLike[str]"]
Report = Dict[str, Any]

__all__ = ["ArrayLike", "Path", "Report", "np", "npt"]
