# SPDX-License-Identifier: BSD-3-Clause
"""The program's stages as functions, and a mapper's loop of one's own."""

import pathlib

import holba
import numpy as np
import pytest


@pytest.fixture(scope="module")
def photo_set(tmp_path_factory) -> pathlib.Path:
    """A database as extraction and matching would give it, and the true model."""
    path = tmp_path_factory.mktemp("photos")
    holba.synthesize(database_path=path / "database.db", output_path=path / "truth", num_images=20, seed=2,
                     scene="sphere")
    return path


@pytest.fixture(scope="module")
def room(tmp_path_factory) -> pathlib.Path:
    path = tmp_path_factory.mktemp("room")
    holba.render(path, room_num_images=6)
    return path


def grow(mapper: holba.Mapper) -> None:
    """The loop of docs/python.md."""
    pair = mapper.find_initial_pair()
    assert pair is not None
    mapper.register_initial_pair(pair)
    for image_id in (pair.image_id1, pair.image_id2):
        mapper.triangulate_image(image_id)
    mapper.adjust_once()
    mapper.filter_points()
    while True:
        for image_id in mapper.rank_next_images():
            if mapper.register_image(image_id).accepted:
                break
        else:
            break
        for image in mapper.images_of_frame(image_id):
            mapper.triangulate_image(image)
            mapper.triangulate_lines(image)
        mapper.adjust_around([image_id])
        if mapper.is_global_due():
            mapper.adjust_all()
    mapper.adjust_all(is_last=True)


def test_a_loop_of_ones_own_finds_the_poses_that_are_true(photo_set):
    mapper = holba.Mapper(photo_set / "database.db", random_seed=0)
    num_images = len(mapper.waiting_images)
    grow(mapper)
    model = mapper.model()
    assert model.find_inconsistency() is None
    assert mapper.num_registered == len(model.images) == num_images and mapper.num_lines > 0
    truth = holba.read_model(photo_set / "truth")
    assert holba.compare_poses(model, truth).auc([1.0])[0] > 80.0


def test_the_mapper_is_repeatable_whatever_the_number_of_threads(photo_set):
    models = []
    for num_threads in (1, 2):
        mapper = holba.Mapper(photo_set / "database.db", structure="none", num_threads=num_threads)
        grow(mapper)
        models.append(mapper.model())
    assert np.array_equal(models[0].points3D.xyz(), models[1].points3D.xyz())
    assert mapper.num_lines == 0


def test_verbs_of_the_mapper_know_its_images(photo_set):
    mapper = holba.Mapper(photo_set / "database.db", structure="none")
    waiting = mapper.waiting_images
    with pytest.raises(KeyError):
        mapper.register_image(10**6)
    with pytest.raises(KeyError):
        mapper.triangulate_image(waiting[0])
    assert {image for image, _, _ in mapper.matched_images(waiting[0])} <= set(waiting)
    grow(mapper)
    image_id = mapper.registered_images[-1]
    before = mapper.num_registered
    mapper.deregister_image(image_id)
    assert mapper.num_registered == before - 1 and image_id in mapper.waiting_images


def test_a_missing_database_is_an_input_error(tmp_path):
    with pytest.raises(holba.InputError, match="no such file"):
        holba.Mapper(tmp_path / "missing.db")
    assert not (tmp_path / "missing.db").exists()


def test_map_writes_models_and_returns_the_report(photo_set, tmp_path):
    report = holba.map(photo_set / "database.db", tmp_path / "sparse", refine=False)
    assert report["models"][0]["images"] == 20
    assert len(holba.read_model(tmp_path / "sparse" / "0").images) == 20


def test_photographs_to_features_to_matches(room, tmp_path):
    database = tmp_path / "database.db"
    report = holba.extract(room / "images", database, max_num_features=800)
    assert len(report["images"]) == 6
    matched = holba.match(database)
    assert matched["pairs"] == 15 and matched["verified"] >= 5
    with pytest.raises(holba.InputError, match="no such"):
        holba.extract(tmp_path / "missing", database)


def test_refine_takes_a_model_and_gives_one_in_which_a_photograph_is_found(room, tmp_path):
    database = tmp_path / "database.db"
    names = sorted(p.name for p in (room / "images").iterdir())
    (tmp_path / "first.txt").write_text("\n".join(names[:-1]))
    (tmp_path / "last.txt").write_text(names[-1])
    holba.extract(room / "images", database, max_num_features=800, image_list_path=tmp_path / "first.txt")
    holba.match(database)
    holba.map(database, tmp_path / "sparse", refine=False, structure="none")
    start = holba.read_model(tmp_path / "sparse" / "0")
    before = start.points3D.xyz(copy=True)
    model, report = holba.refine(start, room / "images", database_path=database)
    assert len(model.lines3D) > 0 and model.find_inconsistency() is None
    assert np.array_equal(before, start.points3D.xyz())
    assert report
    found, located = holba.localize(model, image_path=room / "images", image_list_path=tmp_path / "last.txt")
    assert [image["name"] for image in located["images"]] == [names[-1]]
    assert set(found.images.names()) == set(model.images.names()) | {names[-1]}


def test_commands_are_told_with_a_sentence():
    commands = holba.commands()
    assert {"extract", "match", "map", "refine", "adjust"} <= set(commands)
    with pytest.raises(holba.InputError, match="output_path must be given"):
        holba.run("convert", input_path="x")
    with pytest.raises(holba.InputError, match="unknown|no function"):
        holba.run("extrakt")


def test_convert_and_transform_take_models(scene, model, tmp_path):
    holba.convert(model, tmp_path / "txt", output_type="txt")
    assert (tmp_path / "txt" / "points3D.txt").exists()
    applied = holba.transform(model, tmp_path / "moved", scale=2.0)
    assert applied["scale"] == 2.0
    moved = holba.read_model(tmp_path / "moved")
    np.testing.assert_allclose(moved.points3D.xyz(), 2 * model.points3D.xyz(), rtol=1e-12)
    report = holba.evaluate_poses(moved, holba.read_model(scene / "truth"))
    assert report["registered"] == len(model.images)
