// SPDX-License-Identifier: BSD-3-Clause
// All of a kind in arrays: observations as tables, and records put in one by one as other programs
// have them.
#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <algorithm>

#include "arrays.h"
#include "reconstruction.h"

namespace holba::python {
namespace {

using Sensor = std::tuple<int, uint32_t>;

SensorId ToSensor(int type, uint32_t id) { return {static_cast<SensorType>(type), id}; }

nb::dict PointObservations(const Reconstruction& m) {
  std::vector<uint64_t> points;
  std::vector<uint32_t> images, idxs;
  std::vector<double> xy;
  for (const auto& [id, point] : m.points3D) {
    image_t last = kInvalidId32;
    const Image* image = nullptr;
    for (const PointObservation& o : point.track) {
      if (o.image_id != last || image == nullptr) image = m.FindImage(last = o.image_id);
      points.push_back(id);
      images.push_back(o.image_id);
      idxs.push_back(o.point2D_idx);
      const Eigen::Vector2d& at = image->points2D[o.point2D_idx].xy;
      xy.push_back(at.x());
      xy.push_back(at.y());
    }
  }
  nb::dict out;
  out["point3D_id"] = Owned1(std::move(points));
  out["image_id"] = Owned1(std::move(images));
  out["point2D_idx"] = Owned1(std::move(idxs));
  out["xy"] = OwnedRows<2>(std::move(xy));
  return out;
}

nb::dict LineObservations(const Reconstruction& m) {
  std::vector<uint64_t> lines;
  std::vector<uint32_t> images, idxs;
  std::vector<double> ends;
  for (const auto& [id, line] : m.lines3D) {
    for (const LineObservation& o : line.track) {
      lines.push_back(id);
      images.push_back(o.image_id);
      idxs.push_back(o.line2D_idx);
      const LineSegment2d& s = m.FindImage(o.image_id)->lines2D[o.line2D_idx].segment;
      ends.insert(ends.end(), {s.start.x(), s.start.y(), s.end.x(), s.end.y()});
    }
  }
  nb::dict out;
  out["line3D_id"] = Owned1(std::move(lines));
  out["image_id"] = Owned1(std::move(images));
  out["line2D_idx"] = Owned1(std::move(idxs));
  const size_t n = ends.size() / 4;
  out["ends"] = Owned<Array<double, -1, 2, 2>>(std::move(ends), {n, 2, 2});
  return out;
}

}  // namespace

void BindBulk(nb::class_<Reconstruction>* model) {
  model->def("point_observations", PointObservations,
             nb::sig("def point_observations(self) -> dict[str, numpy.typing.NDArray[typing.Any]]"),
             "All observations of points, in the order of points and tracks: point3D_id (n,), "
             "image_id (n,), "
             "point2D_idx (n,), xy (n, 2) px; copies.");
  model->def("line_observations", LineObservations,
             nb::sig("def line_observations(self) -> dict[str, numpy.typing.NDArray[typing.Any]]"),
             "All observations of lines: line3D_id (n,), image_id (n,), line2D_idx (n,), ends (n, "
             "2, 2) px; copies.");
  // --- For converters: records as they are, tied to each other by their own fields. What is put in
  // so must be checked with find_inconsistency.
  model->def("_put_rig",
             [](Reconstruction& m, rig_t id, std::optional<Sensor> ref,
                const std::vector<std::tuple<int, uint32_t, std::optional<Rigid3d>>>& sensors) {
               Rig rig;
               if (ref) rig.ref_sensor = ToSensor(std::get<0>(*ref), std::get<1>(*ref));
               for (const auto& [type, sensor_id, pose] : sensors)
                 rig.sensors.push_back({ToSensor(type, sensor_id), pose});
               m.rigs.Add(id, std::move(rig));
               m.has_rig_files = true;
             });
  model->def(
      "_put_frame",
      [](Reconstruction& m, frame_t id, rig_t rig_id, std::optional<Rigid3d> pose,
         const std::vector<std::tuple<int, uint32_t, uint64_t>>& data) {
        Frame frame;
        frame.rig_id = rig_id;
        for (const auto& [type, sensor_id, data_id] : data)
          frame.data.push_back({ToSensor(type, sensor_id), data_id});
        if (pose) {
          frame.rig_from_world = *pose;
          m.frames.Add(id, std::move(frame));
        } else {
          m.unregistered_frames.Add(id, std::move(frame));
        }
      },
      nb::arg("id"), nb::arg("rig_id"), nb::arg("pose").none(), nb::arg("data"));
  model->def("_put_image", [](Reconstruction& m, image_t id, std::string name, camera_t camera_id,
                              frame_t frame_id, const ArrayArg<double, -1, 2>& xy,
                              const ArrayArg<uint64_t, -1>& point3D_ids) {
    Image image;
    image.name = std::move(name);
    image.camera_id = camera_id;
    image.frame_id = frame_id;
    for (size_t i = 0; i < xy.shape(0); ++i)
      image.points2D.push_back({Eigen::Vector2d(xy.data() + 2 * i), point3D_ids.data()[i]});
    (m.frames.contains(frame_id) ? m.images : m.unregistered_images).Add(id, std::move(image));
  });
  model->def(
      "_put_points",
      [](Reconstruction& m, const ArrayArg<uint64_t, -1>& ids, const ArrayArg<double, -1, 3>& xyz,
         const ArrayArg<uint8_t, -1, 3>& rgb, const ArrayArg<double, -1>& errors,
         const ArrayArg<uint64_t, -1>& track_begin, const ArrayArg<uint32_t, -1, 2>& tracks) {
        m.points3D.Reserve(ids.shape(0));
        for (size_t i = 0; i < ids.shape(0); ++i) {
          Point3D point;
          point.xyz = Eigen::Vector3d(xyz.data() + 3 * i);
          std::copy_n(rgb.data() + 3 * i, 3, point.rgb.begin());
          point.error = errors.data()[i];
          for (uint64_t k = track_begin.data()[i]; k < track_begin.data()[i + 1]; ++k)
            point.track.push_back({tracks.data()[2 * k], tracks.data()[2 * k + 1]});
          m.points3D.Add(ids.data()[i], std::move(point));
        }
      });
  model->def("_finish", [](Reconstruction& m) {
    m.AddTrivialRigsAndFrames();
    std::vector<std::pair<frame_t, Rigid3d>> poses;
    for (const auto& [id, frame] : m.frames) poses.emplace_back(id, frame.rig_from_world);
    for (const auto& [id, pose] : poses) m.SetFramePose(id, pose);
  });
}

}  // namespace holba::python
