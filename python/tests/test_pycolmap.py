# SPDX-License-Identifier: BSD-3-Clause
"""Models to and from pycolmap's objects."""

import holba
import numpy as np
import pytest
from numpy.testing import assert_array_equal

pycolmap = pytest.importorskip("pycolmap", reason="pycolmap is not installed")


def test_there_and_back_keeps_every_bit_of_what_colmap_knows(scene, tmp_path):
    model = holba.read_model(scene / "perturbed")
    bare = holba.from_pycolmap(holba.to_pycolmap(model))
    assert bare.find_inconsistency() is None
    assert list(bare.points3D) == sorted(model.points3D) and list(bare.images) == sorted(model.images)
    for point_id, point in model.points3D.items():
        other = bare.points3D[point_id]
        assert_array_equal(other.xyz, point.xyz)
        assert (other.rgb, other.error, sorted(other.track)) == (point.rgb, point.error, sorted(point.track))
    for image_id, image in model.images.items():
        other = bare.images[image_id]
        assert other.name == image.name
        assert_array_equal(other.points2D, image.points2D)
        assert_array_equal(other.cam_from_world.translation, image.cam_from_world.translation)
        np.testing.assert_allclose(other.cam_from_world.rotation, image.cam_from_world.rotation, atol=1e-15)
    assert dict(bare.cameras.items()) == dict(model.cameras.items())


def test_pycolmap_reads_what_it_is_given_as_it_reads_our_files(scene, tmp_path):
    model = holba.read_model(scene / "perturbed")
    given = holba.to_pycolmap(model)
    model.write(tmp_path / "model")
    read = pycolmap.Reconstruction(str(tmp_path / "model"))
    assert given.num_reg_images() == read.num_reg_images() == len(model.images)
    assert given.num_points3D() == read.num_points3D()
    assert given.compute_mean_reprojection_error() == pytest.approx(read.compute_mean_reprojection_error())
    for image_id, image in read.images.items():
        other = given.images[image_id]
        np.testing.assert_allclose(other.cam_from_world().matrix(), image.cam_from_world().matrix(), atol=1e-14)
        assert other.num_points3D == image.num_points3D


def test_a_rig_keeps_the_poses_of_its_sensors(tmp_path):
    holba.synthesize(output_path=tmp_path, num_images=12, rig_size=3, seed=4)
    model = holba.read_model(tmp_path / "truth")
    again = holba.from_pycolmap(holba.to_pycolmap(model))
    for rig_id, rig in model.rigs.items():
        other = again.rigs[rig_id]
        assert other.ref_sensor == rig.ref_sensor and len(other.sensors) == len(rig.sensors)
    for image_id, image in model.images.items():
        np.testing.assert_allclose(again.images[image_id].cam_from_world.matrix(), image.cam_from_world.matrix(), atol=1e-12)


def test_images_without_a_pose_stay_without(scene):
    model = holba.read_model(scene / "perturbed")
    image_id = list(model.images)[2]
    model.deregister_image(image_id)
    again = holba.from_pycolmap(holba.to_pycolmap(model))
    assert not again.is_registered(image_id) and again.find_image(image_id) is not None
    assert len(again.images) == len(model.images)
