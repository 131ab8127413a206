# SPDX-License-Identifier: BSD-3-Clause
"""Models: records, verbs, arrays that show them, files, copies."""

import copy
import gc
import pathlib
import pickle
import weakref

import holba
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal


def files_of(model: holba.Reconstruction, path: pathlib.Path) -> dict:
    model.write(path)
    return {p.name: p.read_bytes() for p in path.iterdir()}


def small() -> holba.Reconstruction:
    """Two posed images that see three points."""
    model = holba.Reconstruction()
    camera_id = model.add_camera(holba.Camera("PINHOLE", 100, 80, [50, 50, 50, 40]))
    for i in range(2):
        image_id = model.add_image(f"{i}.jpg", camera_id, np.arange(8.0).reshape(4, 2))
        model.register_image(image_id, holba.Rigid3d([0, 0, 0, 1], [-float(i), 0, 5]))
    for k in range(3):
        model.add_point3D([k, 0, 0], [(1, k), (2, k)], rgb=(k, 2, 3))
    assert model.find_inconsistency() is None
    return model


def test_a_model_is_read_and_written_with_every_bit(scene, tmp_path):
    model = holba.read_model(scene / "perturbed")
    assert files_of(model, tmp_path / "out") == {p.name: p.read_bytes() for p in (scene / "perturbed").iterdir()}


def test_copies_and_pickles_have_every_bit_and_share_nothing(model, tmp_path):
    expected = files_of(model, tmp_path / "model")
    copies = [model.copy(), copy.copy(model), copy.deepcopy(model), pickle.loads(pickle.dumps(model))]
    model.points3D.xyz(copy=False)[:] = 0.0
    for i, other in enumerate(copies):
        assert files_of(other, tmp_path / str(i)) == expected


def test_values_are_pickled():
    camera = holba.Camera("OPENCV", 640, 480, [500, 501, 320, 240, 0.1, 0.2, 0, 0])
    rigid = holba.Rigid3d([0.1, 0.2, 0.3, 0.9], [1, 2, 3])
    sim = holba.Sim3d(2.0, [0, 0, 0, 1], [1, 2, 3])
    for value in (camera, rigid, sim):
        assert pickle.loads(pickle.dumps(value)) == value


def test_a_faulty_file_is_an_input_error_that_names_it(tmp_path):
    with pytest.raises(holba.InputError, match="missing"):
        holba.read_model(tmp_path / "missing")
    assert issubclass(holba.InputError, (holba.Error, ValueError))
    (tmp_path / "cameras.txt").write_text("1 PINHOLE 10 x\n")
    (tmp_path / "images.txt").write_text("")
    (tmp_path / "points3D.txt").write_text("")
    with pytest.raises(holba.InputError, match=r"cameras.txt:1"):
        holba.read_model(tmp_path)


def test_maps_are_like_dicts(model):
    points = model.points3D
    ids = list(points)
    assert len(points) == len(ids) and ids[0] in points and -1 not in points and "x" not in points
    assert [p.id for p in points.values()] == ids
    assert points.get(2**40) is None
    with pytest.raises(KeyError, match="there is no point"):
        points[2**40]
    assert_array_equal(points.ids(), np.array(ids, dtype=np.uint64))


def test_a_record_that_is_gone_is_a_key_error_and_never_other_memory():
    model = small()
    point = model.points3D[2]
    model.delete_point3D(2)
    assert 2 not in model.points3D
    for use in (lambda: point.xyz, lambda: point.track, lambda: repr(point), lambda: point.group_ids):
        with pytest.raises(KeyError):
            use()


def test_points_are_seen_and_moved_without_a_copy(model):
    xyz = model.points3D.xyz(copy=False)
    assert xyz.shape == (len(model.points3D), 3) and not xyz.flags.owndata
    first = next(iter(model.points3D))
    xyz[0] = [1, 2, 3]
    assert_array_equal(model.points3D[first].xyz, [1, 2, 3])
    model.points3D[first].xyz = (4, 5, 6)
    assert_array_equal(xyz[0], [4, 5, 6])
    copied = model.points3D.xyz(copy=True)
    copied[0] = 0
    assert_array_equal(xyz[0], [4, 5, 6])


def test_arrays_keep_the_model_alive_and_follow_the_order_of_ids(model):
    expected = np.array([p.xyz for p in model.points3D.values()])
    xyz = model.points3D.xyz()
    assert_array_equal(xyz, expected)
    ref = weakref.ref(model) if hasattr(model, "__weakref__") else None
    del model, ref
    gc.collect()
    assert_array_equal(xyz, expected)


def test_where_records_do_not_lie_in_a_row_a_view_is_refused_and_a_copy_is_right(model):
    ids = list(model.points3D)
    model.delete_point3D(ids[3])
    with pytest.raises(ValueError, match="copy"):
        model.points3D.xyz(copy=False)
    assert_array_equal(model.points3D.xyz(), [p.xyz for p in model.points3D.values()])
    again = model.copy()
    assert_array_equal(again.points3D.xyz(copy=False), model.points3D.xyz())


def test_poses_are_shown_and_cannot_be_written(model):
    quats, translations = model.images.quaternions(copy=False), model.images.translations(copy=False)
    for image, q, t in zip(model.images.values(), quats, translations):
        pose = image.cam_from_world
        assert_array_equal(pose.quat, q)
        assert_array_equal(pose.translation, t)
    with pytest.raises(ValueError):
        quats[0, 0] = 1.0
    frame_id = next(iter(model.frames))
    model.set_frame_pose(frame_id, holba.Rigid3d([0, 0, 0, 1], [7, 8, 9]))
    assert_array_equal(model.frames.translations(copy=False)[0], [7, 8, 9])
    assert_array_equal(translations[0], [7, 8, 9])
    assert_allclose(model.images.centres()[0], [-7, -8, -9])


def test_features_that_arrays_show_do_not_move():
    model = small()
    image = model.images[1]
    xy, ids = image.points2D, image.point3D_ids
    assert_array_equal(xy, np.arange(8.0).reshape(4, 2))
    assert list(ids) == [1, 2, 3, holba.NO_ID]
    xy[3] = [9, 9]
    assert_array_equal(image.points2D[3], [9, 9])
    with pytest.raises(ValueError):
        ids[0] = 5
    with pytest.raises(BufferError, match="views"):
        model.add_point2D(1, [1, 1])
    with pytest.raises(BufferError):
        model.remove_points2D(1, lambda idx: True)
    del xy, ids
    gc.collect()
    assert model.add_point2D(1, [1, 1]) == 4
    model.deregister_image(1)
    assert_array_equal(model.unregistered_images[1].points2D[4], [1, 1])


def test_every_verb_keeps_the_model_consistent():
    model = small()
    a, b, c = model.points3D
    line = model.add_line3D([0, 0, 0], [1, 0, 0])
    segment = model.add_line2D(1, [0, 0], [5, 5])
    model.add_line_observation(line, 1, segment)
    assert model.lines3D[line].track == [(1, segment)]
    plane = model.add_group3D("PLANE", [0, 0, 1, 0], [a, b])
    other = model.add_group3D("PLANE", [0, 1, 0, 0])
    vp = model.add_group3D("VP", [1, 0, 0], line3D_ids=[line])
    assert model.add_point_member(plane, c) and not model.add_point_member(plane, c)
    assert model.delete_point_member(plane, a) and model.add_line_member(plane, line)
    assert sorted(model.points3D[c].group_ids) == [plane]
    assert model.add_edge(a, line, 2) and not model.add_edge(a, line)
    assert model.wireframe == [(a, line, 2)] and model.points3D[a].line_ids == [line]
    assert model.add_relation(plane, other, "orthogonal")
    assert model.relations == [(plane, other, "orthogonal")]
    group2D = model.add_group2D(1, "PLANE", [0, 1])
    model.add_group_observation(plane, 1, group2D)
    assert model.images[1].groups2D == [("PLANE", plane, [0, 1], [])]
    assert model.find_inconsistency() is None
    model.delete_group_observation(1, group2D)
    model.set_members(other, [a], [])
    model.merge_groups3D(plane, other)
    assert set(model.groups3D[plane].point3D_ids) == {a, b, c} and model.relations == []
    model.delete_point_observation(2, 2)
    assert model.points3D[c].track == [(1, 2)]
    model.add_point_observation(c, 2, 3)
    model.merge_points3D(a, b)
    assert b not in model.points3D and len(model.points3D[a].track) == 4
    assert_allclose(model.points3D[a].xyz, [0.5, 0, 0])
    line2 = model.add_line3D([2, 0, 0], [3, 0, 0])
    model.merge_lines3D(line, line2)
    assert_allclose(sorted([model.lines3D[line].start[0], model.lines3D[line].end[0]]), [0, 3])
    assert model.delete_edge(a, line) and model.delete_line_member(vp, line)
    model.delete_line_observation(1, segment)
    model.remove_lines2D(1, lambda idx: idx == segment)
    model.remove_groups2D(1, lambda idx: True)
    model.remove_points2D(2, lambda idx: idx == 0)
    model.delete_lines3D([line])
    model.delete_groups3D([vp, plane])
    model.delete_points3D([a])
    assert model.find_inconsistency() is None
    model.deregister_frame(model.images[2].frame_id)
    assert not model.is_registered(2) and model.find_image(2).cam_from_world is None
    model.register_image(2, holba.Rigid3d())
    assert model.find_inconsistency() is None


def test_a_verb_with_unknown_ids_raises_and_changes_nothing(tmp_path):
    model = small()
    before = files_of(model, tmp_path / "a")
    for verb in (
        lambda: model.add_point3D([0, 0, 0], [(1, 0)]),  # that keypoint observes another point
        lambda: model.add_point_observation(99, 1, 3),
        lambda: model.merge_points3D(1, 99),
        lambda: model.add_group3D("PLANE", [0, 0, 1, 0], [99]),
        lambda: model.add_image("x", 99),
    ):
        with pytest.raises(holba.CheckError):
            verb()
    with pytest.raises(holba.InputError, match="PLANE"):
        model.add_group3D("PLANE", [0, 0, 3, 0])
    with pytest.raises(holba.InputError, match="SPHERE"):
        model.add_group3D("BALL", [0, 0, 3, 0])
    assert files_of(model, tmp_path / "b") == before


def test_an_exception_of_a_question_ends_the_verb_before_it_does_anything():
    model = small()

    def ask(idx):
        raise RuntimeError("no answer")

    with pytest.raises(RuntimeError, match="no answer"):
        model.remove_points2D(1, ask)
    assert len(model.images[1].points2D) == 4 and model.find_inconsistency() is None


def test_observations_as_tables_are_those_of_the_tracks(model):
    table = model.point_observations()
    expected = [(i, *o) for i, p in model.points3D.items() for o in p.track]
    assert list(zip(table["point3D_id"], table["image_id"], table["point2D_idx"])) == expected
    for k in (0, len(expected) // 2, -1):
        _, image_id, idx = expected[k]
        assert_array_equal(table["xy"][k], model.images[image_id].points2D[idx])
    lines = model.line_observations()
    assert len(lines["line3D_id"]) == sum(len(line.track) for line in model.lines3D.values())
    k = 5
    segment = model.images[int(lines["image_id"][k])].lines2D[lines["line2D_idx"][k]]
    assert_array_equal(lines["ends"][k], segment)


def test_cameras_project_and_unproject_as_their_formulas_say():
    K = holba.Camera("PINHOLE", 640, 480, [500, 510, 320, 240])
    points = np.array([[0.1, 0.2, 1.0], [-1, 2, 4], [0, 0, -1]])
    pixels = K.project(points)
    assert_allclose(pixels[:2], points[:2, :2] / points[:2, 2:] * [500, 510] + [320, 240])
    assert np.isnan(pixels[2]).all()
    rays = K.unproject(pixels[:2])
    assert_allclose(rays, points[:2] / np.linalg.norm(points[:2], axis=1, keepdims=True), atol=1e-12)
    assert_allclose(K.calibration_matrix(), [[500, 0, 320], [0, 510, 240], [0, 0, 1]])
    assert list(K.replace(params=[1, 1, 2, 2]).params) == [1, 1, 2, 2] and K.width == 640
    with pytest.raises(AttributeError):
        K.width = 3
    with pytest.raises(holba.InputError, match="fx fy cx cy"):
        holba.Camera("PINHOLE", 1, 1, [1])
    with pytest.raises(holba.InputError, match="OPENCV_FISHEYE"):
        holba.Camera("PINHOL", 1, 1, [1])


def test_rigid_motions_and_similarities_compose_as_matrices():
    rng = np.random.default_rng(1)

    def random_rigid():
        return holba.Rigid3d(rng.normal(size=4), rng.normal(size=3))

    def matrix(T):
        s = getattr(T, "scale", 1.0)
        return np.block([[s * T.rotation, T.translation[:, None]], [np.zeros(3), 1.0]])

    a, b = random_rigid(), random_rigid()
    X = rng.normal(size=(5, 3))
    assert_allclose(matrix(a * b), matrix(a) @ matrix(b), atol=1e-14)
    assert_allclose(matrix(a.inverse()), np.linalg.inv(matrix(a)), atol=1e-14)
    assert_allclose(a * X, X @ a.rotation.T + a.translation, atol=1e-14)
    assert_allclose(a * a.centre(), 0, atol=1e-14)
    assert_allclose(holba.Rigid3d(a.rotation, a.translation).quat, a.quat * np.sign(a.quat @ holba.Rigid3d(a.rotation, a.translation).quat), atol=1e-14)
    s, t = holba.Sim3d(2.0, b.quat, b.translation), holba.Sim3d(0.3, a.quat, a.translation)
    assert_allclose(matrix(s * t), matrix(s) @ matrix(t), atol=1e-14)
    assert_allclose(matrix(s.inverse()), np.linalg.inv(matrix(s)), atol=1e-14)
    with pytest.raises(ValueError, match="rotation"):
        holba.Rigid3d(np.eye(3) * 2, [0, 0, 0])


def test_a_similarity_moves_everything_alike(model):
    before = model.copy()
    sim = holba.Sim3d(2.0, [0.1, 0.2, 0.3, 0.9], [1, 2, 3])
    terms = holba.evaluate(model)
    model.transform(sim)
    assert_allclose(model.points3D.xyz(), sim * before.points3D.xyz(), rtol=1e-12)
    assert_allclose(model.images.centres(), sim * before.images.centres(), rtol=1e-10, atol=1e-10)
    for name, term in holba.evaluate(model).items():
        assert_allclose(term.sum_squares, terms[name].sum_squares, rtol=1e-6)
    aligned = holba.align(model, before)
    assert_allclose(aligned.scale, 0.5, rtol=1e-9)


def test_errors_of_poses_are_those_of_a_rotation_put_in(scene):
    truth = holba.read_model(scene / "truth")
    model = truth.copy()
    angle = np.radians(2.0)
    image = next(iter(model.images.values()))
    turn = holba.Rigid3d([np.sin(angle / 2), 0, 0, np.cos(angle / 2)], [0, 0, 0])
    model.set_frame_pose(image.frame_id, turn * image.cam_from_world)
    errors = holba.compare_poses(model, truth)
    n = len(truth.images)
    assert errors.registered == n and len(errors.pair_deg) == n * (n - 1) // 2
    assert_allclose(np.sort(errors.rotation_deg)[-(n - 1) :], 2.0, atol=1e-6)
    share = (n - 1) / (n * (n - 1) / 2)
    assert_allclose(errors.auc([1.0])[0], 100 * (1 - share), atol=1e-4)
    assert holba.compare_to_truth(truth, truth).values["position_rms"] < 1e-9
