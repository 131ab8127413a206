# SPDX-License-Identifier: BSD-3-Clause
"""The stages of the mapper, for incremental loops of one's own."""

from __future__ import annotations

from typing import Optional

from typing_extensions import Unpack

from . import _core, _options
from ._keywords import MapperKeywords
from ._types import Path


class Mapper(_core._Mapper):
    """A model that grows, and the stages that let it (docs/python.md has a loop of twenty lines)."""

    def __init__(
        self, database_path: Path, *, image_path: Optional[Path] = None, **options: Unpack[MapperKeywords]
    ) -> None:
        """Reads a database with keypoints and verified matches, as `holba map` does.

        image_path: folder of the photographs, for structure that the database lacks. Raises InputError.
        Options (keywords):
        """
        super().__init__(_options.table("mapper").bind(options), database_path, image_path)
