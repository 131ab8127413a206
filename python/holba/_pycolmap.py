# SPDX-License-Identifier: BSD-3-Clause
"""Models to and from pycolmap's objects, without files."""

from __future__ import annotations

from typing import Any

import numpy as np

from ._core import NO_ID, Camera, Reconstruction, Rigid3d
from ._errors import InputError


def _pose(rigid: Any) -> Rigid3d:
    return Rigid3d(np.asarray(rigid.rotation.quat, dtype=float), np.asarray(rigid.translation, dtype=float))


def from_pycolmap(reconstruction: Any) -> Reconstruction:
    """The model of a pycolmap.Reconstruction (3.12 and later, with rigs and frames).

    Ids stay, and records come in the order of their ids. Frames without a pose and their images come as unregistered
    ones. Raises InputError if it contradicts itself.
    """
    model = Reconstruction()
    for camera_id, camera in sorted(reconstruction.cameras.items()):
        model.cameras[camera_id] = Camera(
            camera.model.name, camera.width, camera.height, np.asarray(camera.params, dtype=float)
        )
    for rig_id, rig in sorted(reconstruction.rigs.items()):
        ref = rig.ref_sensor_id
        sensors = [
            (_sensor_type(sensor), sensor.id, None if pose is None else _pose(pose))
            for sensor, pose in rig.non_ref_sensors.items()
        ]
        model._put_rig(rig_id, (_sensor_type(ref), ref.id), sensors)
    for frame_id, frame in sorted(reconstruction.frames.items()):
        data = [(_sensor_type(d.sensor_id), d.sensor_id.id, d.id) for d in frame.data_ids]
        pose = _pose(frame.rig_from_world) if frame.has_pose() else None
        model._put_frame(frame_id, frame.rig_id, pose, sorted(data))
    for image_id, image in sorted(reconstruction.images.items()):
        points = image.points2D
        xy = np.array([p.xy for p in points], dtype=float).reshape(-1, 2)
        ids = np.array([p.point3D_id if p.has_point3D() else NO_ID for p in points], dtype=np.uint64)
        model._put_image(image_id, image.name, image.camera_id, image.frame_id, xy, ids)
    point_ids = sorted(reconstruction.points3D)
    points3D = [reconstruction.points3D[i] for i in point_ids]
    tracks = [[(e.image_id, e.point2D_idx) for e in p.track.elements] for p in points3D]
    begin = np.concatenate([[0], np.cumsum([len(t) for t in tracks])]).astype(np.uint64)
    model._put_points(
        np.array(point_ids, dtype=np.uint64),
        np.array([p.xyz for p in points3D], dtype=float).reshape(-1, 3),
        np.array([p.color for p in points3D], dtype=np.uint8).reshape(-1, 3),
        np.array([p.error for p in points3D], dtype=float),
        begin,
        np.array([e for t in tracks for e in t], dtype=np.uint32).reshape(-1, 2),
    )
    model._finish()
    wrong = model.find_inconsistency()
    if wrong is not None:
        raise InputError(f"this pycolmap.Reconstruction contradicts itself: {wrong}")
    return model


def _sensor_type(sensor: Any) -> int:
    return {"CAMERA": 0, "IMU": 1}.get(sensor.type.name, -1)


def to_pycolmap(model: Reconstruction) -> Any:
    """A pycolmap.Reconstruction of the model's cameras, rigs, frames, images and points; ids stay.

    What COLMAP does not know (lines, groups, wireframe, relations) is left out. Needs pycolmap 3.12 or later.
    """
    import pycolmap  # type: ignore[import-not-found, import-untyped, unused-ignore]

    out = pycolmap.Reconstruction()
    for camera_id, camera in model.cameras.items():
        out.add_camera(
            pycolmap.Camera(
                camera_id=camera_id,
                model=camera.model,
                width=camera.width,
                height=camera.height,
                params=camera.params,
            )
        )
    types = {0: pycolmap.SensorType.CAMERA, 1: pycolmap.SensorType.IMU}
    for rig_id, rig in model.rigs.items():
        made_rig = pycolmap.Rig()
        made_rig.rig_id = rig_id
        if rig.ref_sensor is not None:
            made_rig.add_ref_sensor(pycolmap.sensor_t(types[rig.ref_sensor[0]], rig.ref_sensor[1]))
        for sensor_type, sensor_id, pose in rig.sensors:
            sensor = pycolmap.sensor_t(types[sensor_type], sensor_id)
            made_rig.add_sensor(sensor, None if pose is None else _to_rigid(pycolmap, pose))
        out.add_rig(made_rig)
    frames = [*model.frames.items(), *model.unregistered_frames.items()]
    for frame_id, frame in frames:
        made_frame = pycolmap.Frame()
        made_frame.frame_id = frame_id
        made_frame.rig_id = frame.rig_id
        for sensor_type, sensor_id, data_id in frame.data_ids:
            made_frame.add_data_id(pycolmap.data_t(pycolmap.sensor_t(types[sensor_type], sensor_id), data_id))
        pose = frame.rig_from_world
        if pose is not None:
            made_frame.rig_from_world = _to_rigid(pycolmap, pose)
        out.add_frame(made_frame)
    for image_id, image in [*model.images.items(), *model.unregistered_images.items()]:
        made_image = pycolmap.Image(name=image.name, camera_id=image.camera_id, image_id=image_id)
        made_image.frame_id = image.frame_id
        made_image.points2D = pycolmap.Point2DList([pycolmap.Point2D(xy) for xy in image.points2D])
        out.add_image(made_image)
    for point_id, point in model.points3D.items():
        track = pycolmap.Track()
        for image_id, idx in point.track:
            track.add_element(image_id, idx)
        made_point = pycolmap.Point3D()
        made_point.xyz = point.xyz
        made_point.color = np.array(point.rgb, dtype=np.uint8)
        made_point.error = point.error
        made_point.track = track
        out.add_point3D_with_id(point_id, made_point)
    return out


def _to_rigid(pycolmap: Any, pose: Rigid3d) -> Any:
    return pycolmap.Rigid3d(pycolmap.Rotation3d(pose.quat), pose.translation)
