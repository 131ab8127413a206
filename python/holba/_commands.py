# SPDX-License-Identifier: BSD-3-Clause
"""The commands of the program as functions. Where one reads a model folder, a Reconstruction is taken, too."""

from __future__ import annotations

import json
import os
import tempfile
from typing import Any, Dict, Optional, Tuple, Union

from typing_extensions import Unpack

from . import _core, _keywords, _options
from ._core import Reconstruction
from ._types import Path, Report

Model = Union[Path, Reconstruction]


def run(command: str, **options: Any) -> Union[Report, str, None]:
    """Runs a command of the program: run("evaluate", input_path="sparse/0").

    Returns what `holba COMMAND --json` prints as dict, the text of a command without JSON, None of one that prints
    nothing. Raises InputError as the program's message. Other threads run meanwhile; Ctrl-C leaves the old output.
    """
    made = _options.command_table(command).bind(options)
    text: str = made.run()
    if not text:
        return None
    if not made.supports_json:
        return text
    report: Report = json.loads(text)
    return report


def _report(command: str, options: Any) -> Report:
    result = run(command, **options)
    return result if isinstance(result, dict) else {}


class _Folder:
    """A temporary folder for models that are in memory."""

    def __init__(self) -> None:
        self._folder: Optional[tempfile.TemporaryDirectory[str]] = None

    def __enter__(self) -> "_Folder":
        return self

    def __exit__(self, *_: object) -> None:
        if self._folder is not None:
            self._folder.cleanup()

    def path(self, name: str) -> str:
        if self._folder is None:
            self._folder = tempfile.TemporaryDirectory(prefix="holba-")
        return os.path.join(self._folder.name, name)

    def input(self, model: Model, name: str = "input") -> str:
        """Where the program reads a model."""
        if not isinstance(model, Reconstruction):
            return os.fspath(model)
        path = self.path(name)
        model.write(path)
        return path


def extract(image_path: Path, database_path: Path, **options: Unpack[_keywords.ExtractKeywords]) -> Report:
    """Finds points, lines and vanishing points in the photographs of a folder, into a COLMAP database.

    What an image has already is kept: a run that was interrupted goes on where it was. Returns the report of
    `holba extract --json`. Raises InputError if no photograph can be used. Options (keywords):
    """
    return _report("extract", {**options, "image_path": image_path, "database_path": database_path})


def match(database_path: Path, **options: Unpack[_keywords.MatchKeywords]) -> Report:
    """Matches the features of a database's images and verifies the matches.

    Pairs that are there already stay as they are. Returns the report of `holba match --json`. Options (keywords):
    """
    return _report("match", {**options, "database_path": database_path})


def map(  # noqa: A001: the name of the command
    database_path: Path,
    output_path: Path,
    *,
    image_path: Optional[Path] = None,
    input_path: Optional[Model] = None,
    **options: Unpack[_keywords.MapKeywords],
) -> Report:
    """Posed models of points, lines and groups of a database's images: the folders 0, 1, ... of output_path.

    image_path: folder of the photographs, for structure that the database lacks, colours and pictures.
    input_path: a model (or its folder) that is continued with further images. Returns the report of
    `holba map --json`; loops of one's own: MapperState. Options (keywords):
    """
    with _Folder() as folder:
        given: Dict[str, Any] = {**options, "database_path": database_path, "output_path": output_path}
        if image_path is not None:
            given["image_path"] = image_path
        if input_path is not None:
            given["input_path"] = folder.input(input_path)
        return _report("map", given)


def reconstruct(image_path: Path, output_path: Path, **options: Unpack[_keywords.ReconstructKeywords]) -> Report:
    """Photographs to posed models of points, lines and groups: extract, match and map with their defaults.

    The models are the folders 0, 1, ... of output_path. Returns the report of `holba reconstruct --json`.
    Options (keywords):
    """
    return _report("reconstruct", {**options, "image_path": image_path, "output_path": output_path})


def refine(
    model: Model,
    image_path: Path,
    output_path: Optional[Path] = None,
    **options: Unpack[_keywords.RefineKeywords],
) -> Tuple[Reconstruction, Report]:
    """Builds lines, groups and wireframe on a posed model, and adjusts all of it (docs/refine.md).

    model: with poses and points, or its folder; it stays as it is. image_path: folder of the photographs.
    output_path: where pictures, PLY and the database go beside the model; None: nothing is kept. Returns the
    holistic model and the report of `holba refine --json`. Raises InputError. Options (keywords):
    """
    with _Folder() as folder:
        given: Dict[str, Any] = {**options, "image_path": image_path, "input_path": folder.input(model)}
        if output_path is None:
            output_path = folder.path("output")
            given.setdefault("num_pictures", 0)
        given["output_path"] = output_path
        report = _report("refine", given)
        return _core.read_model(output_path), report


def localize(
    model: Model,
    *,
    image_path: Optional[Path] = None,
    database_path: Optional[Path] = None,
    output_path: Optional[Path] = None,
    **options: Unpack[_keywords.LocalizeKeywords],
) -> Tuple[Reconstruction, Report]:
    """Poses of new photographs in a finished model, which stays as it is (docs/localize.md).

    Returns a model with the new images and the report of `holba localize --json` (poses, covariances, failures).
    Raises InputError. Options (keywords):
    """
    with _Folder() as folder:
        given: Dict[str, Any] = {**options, "input_path": folder.input(model), "write_model": True}
        if image_path is not None:
            given["image_path"] = image_path
        if database_path is not None:
            given["database_path"] = database_path
        given["output_path"] = folder.path("output") if output_path is None else output_path
        report = _report("localize", given)
        return _core.read_model(given["output_path"]), report


def evaluate_poses(model: Model, ground_truth: Model, **options: Unpack[_keywords.EvaluatePosesKeywords]) -> Report:
    """Area under the curve of relative pose errors, as `holba evaluate_poses --json`. Options (keywords):"""
    with _Folder() as folder:
        given: Dict[str, Any] = {**options, "input_path": folder.input(model)}
        truth = ground_truth
        if isinstance(truth, Reconstruction):
            path = folder.path("truth")
            truth.write(path)
            truth = path
        return _report("evaluate_poses", {**given, "ground_truth_path": truth})


def render(output_path: Path, **options: Unpack[_keywords.RenderKeywords]) -> None:
    """Photographs of a small room with known cameras, for tests and demonstrations. Options (keywords):"""
    run("render", **options, output_path=output_path)


def synthesize(**options: Unpack[_keywords.SynthesizeKeywords]) -> None:
    """A synthetic adjustment problem, or the database of a synthetic set of photographs. Options (keywords):"""
    run("synthesize", **options)


def inspect(**options: Unpack[_keywords.InspectKeywords]) -> Union[Report, str, None]:
    """What a database holds, in numbers and as a picture. Options (keywords):"""
    return run("inspect", **options)


def convert(input_path: Model, output_path: Path, **options: Unpack[_keywords.ConvertKeywords]) -> None:
    """Writes a model as text, binary, PLY or BAL. Options (keywords):"""
    with _Folder() as folder:
        given: Dict[str, Any] = {**options, "input_path": folder.input(input_path), "output_path": output_path}
        run("convert", **given)


def transform(input_path: Model, output_path: Path, **options: Unpack[_keywords.TransformKeywords]) -> Report:
    """Moves, turns and scales a model; of one in memory Reconstruction.transform does. Options (keywords):"""
    with _Folder() as folder:
        return _report("transform", {**options, "input_path": folder.input(input_path), "output_path": output_path})


def bench(**options: Unpack[_keywords.BenchKeywords]) -> Union[Report, str, None]:
    """The benchmarks. Options (keywords):"""
    return run("bench", **options)


def view(
    model: Model,
    output_path: Path,
    *,
    image_path: Optional[Path] = None,
    compare_path: Optional[Model] = None,
    **options: Unpack[_keywords.ViewKeywords],
) -> None:
    """Writes one page that shows a model in any browser (docs/view.md).

    image_path: folder of the photographs; None: without them. compare_path: a second model of the same photographs, aligned
    to the first. Raises InputError. Options (keywords):
    """
    with _Folder() as folder:
        given: Dict[str, Any] = {**options, "input_path": folder.input(model), "output_path": output_path}
        if image_path is not None:
            given["image_path"] = image_path
        if compare_path is not None:
            given["compare_path"] = folder.input(compare_path, "compare")
        run("view", **given)
