# SPDX-License-Identifier: BSD-3-Clause
"""Scenes that the tests share, made once."""

import pathlib

import holba
import pytest


@pytest.fixture(scope="session")
def scene(tmp_path_factory: pytest.TempPathFactory) -> pathlib.Path:
    """Folder with the models truth and perturbed: points, lines, planes, vanishing points, wireframe."""
    path = tmp_path_factory.mktemp("scene")
    holba.synthesize(output_path=path, num_images=20, vps=True, primitives=1, seed=1)
    return path


@pytest.fixture()
def model(scene: pathlib.Path) -> holba.Reconstruction:
    """A start of an adjustment, of the test's own."""
    return holba.read_model(scene / "perturbed")
