# SPDX-License-Identifier: BSD-3-Clause
"""The page of `holba view` in a notebook."""

from __future__ import annotations

import html
import os
import tempfile
from typing import Optional

from typing_extensions import Unpack

from . import _commands, _keywords
from ._commands import Model
from ._types import Path


class View:
    """The page that shows a model. In a notebook it is a frame; elsewhere page is the text of the HTML file."""

    def __init__(self, page: str, height_px: int) -> None:
        self.page = page
        self.height_px = height_px

    def write(self, path: Path) -> None:
        """Writes the page to a file that any browser opens."""
        with open(path, "w", encoding="utf-8", newline="") as file:
            file.write(self.page)

    def _repr_html_(self) -> str:
        # The page asks for nothing, so that it may do nothing but run its own script.
        return (
            f'<iframe srcdoc="{html.escape(self.page)}" sandbox="allow-scripts allow-downloads allow-modals" '
            f'width="100%" height="{self.height_px}" style="border: 0" title="holba view"></iframe>'
        )

    def __repr__(self) -> str:
        return f"View({len(self.page) / 1e6:.1f} MB of HTML; in a notebook it is shown, write(path) saves it)"


def show(
    model: Model,
    *,
    image_path: Optional[Path] = None,
    compare_path: Optional[Model] = None,
    height_px: int = 600,
    **options: Unpack[_keywords.ViewKeywords],
) -> View:
    """The page of a model as an object that notebooks show in a frame; model.show() is the same.

    height_px: of the frame. Others as for view. Raises InputError.
    """
    with tempfile.TemporaryDirectory(prefix="holba-") as folder:
        path = os.path.join(folder, "view.html")
        _commands.view(model, path, image_path=image_path, compare_path=compare_path, **options)
        with open(path, encoding="utf-8", newline="") as file:
            return View(file.read(), height_px)
