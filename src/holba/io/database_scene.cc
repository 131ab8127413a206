// SPDX-License-Identifier: BSD-3-Clause
#include "holba/io/database_scene.h"

#include <algorithm>
#include <utility>

#include "holba/base/error.h"
#include "holba/io/database_statement.h"

namespace holba {

std::map<rig_t, Rig> Database::ReadRigs() const {
  std::map<rig_t, Rig> rigs;
  if (!has_rigs_) return rigs;
  Statement rows(*this, "SELECT rig_id, ref_sensor_id, ref_sensor_type FROM rigs ORDER BY rig_id");
  while (rows.Step()) {
    rigs[static_cast<rig_t>(rows.GetInteger(0))].ref_sensor = SensorId{
        static_cast<SensorType>(rows.GetInteger(2)), static_cast<uint32_t>(rows.GetInteger(1))};
  }
  Statement sensors(*this,
                    "SELECT rig_id, sensor_id, sensor_type, sensor_from_rig FROM rig_sensors "
                    "ORDER BY rig_id, sensor_type, sensor_id");
  while (sensors.Step()) {
    const auto rig_id = static_cast<rig_t>(sensors.GetInteger(0));
    Rig::Sensor sensor{{static_cast<SensorType>(sensors.GetInteger(2)),
                        static_cast<uint32_t>(sensors.GetInteger(1))},
                       std::nullopt};
    if (!sensors.GetBytes(3).empty()) {
      const auto pose = sensors.GetArray<double>(3, 7, 1);
      const std::string key = fmt::format("rig_id = {}, sensor_id = {}", rig_id, sensor.id.id);
      if (!pose) {
        FailRow("rig_sensors", key,
                fmt::format("expected 7 numbers in sensor_from_rig, found {} bytes",
                            sensors.GetBytes(3).size()));
      }
      const Eigen::Quaterniond q((*pose)[0], (*pose)[1], (*pose)[2], (*pose)[3]);
      if (!AllFinite(*pose) || !(q.norm() > 0.0)) {
        FailRow("rig_sensors", key,
                "expected a rotation and finite numbers in sensor_from_rig; write the rig anew");
      }
      sensor.sensor_from_rig =
          Rigid3d(q.normalized(), Eigen::Vector3d((*pose)[4], (*pose)[5], (*pose)[6]));
    }
    rigs[rig_id].sensors.push_back(sensor);
  }
  return rigs;
}

std::map<frame_t, Frame> Database::ReadFrames() const {
  std::map<frame_t, Frame> frames;
  if (!has_rigs_) return frames;
  Statement rows(*this, "SELECT frame_id, rig_id FROM frames ORDER BY frame_id");
  while (rows.Step())
    frames[static_cast<frame_t>(rows.GetInteger(0))].rig_id =
        static_cast<rig_t>(rows.GetInteger(1));
  Statement data(*this,
                 "SELECT frame_id, data_id, sensor_id, sensor_type FROM frame_data "
                 "ORDER BY frame_id, sensor_type, sensor_id, data_id");
  while (data.Step()) {
    const auto frame = frames.find(static_cast<frame_t>(data.GetInteger(0)));
    if (frame == frames.end()) continue;
    frame->second.data.push_back(
        {{static_cast<SensorType>(data.GetInteger(3)), static_cast<uint32_t>(data.GetInteger(2))},
         static_cast<uint64_t>(data.GetInteger(1))});
  }
  return frames;
}

namespace {

bool HasAllPoses(const Rig& rig) {
  return rig.ref_sensor && std::all_of(rig.sensors.begin(), rig.sensors.end(),
                                       [](const auto& s) { return s.sensor_from_rig.has_value(); });
}

}  // namespace

DatabaseScene ReadScene(const Database& database, const ImageFeatureMap& features) {
  DatabaseScene result;
  Reconstruction& scene = result.scene;
  for (const auto& [id, camera] : database.ReadCameras()) {
    scene.cameras.Add(id, camera.camera);
    if (camera.has_prior_focal_length) result.cameras_of_known_focal_length.insert(id);
  }
  const std::map<rig_t, Rig> rigs = database.ReadRigs();
  const std::map<image_t, DatabaseImage> images = database.ReadImages();
  std::map<image_t, frame_t> frame_of_image;
  for (const auto& [frame_id, frame] : database.ReadFrames()) {
    const auto rig = rigs.find(frame.rig_id);
    if (rig == rigs.end()) continue;
    Frame complete = frame;
    // What is not of a camera, or an image of another camera than the database has it, is not the
    // mapper's.
    std::erase_if(complete.data, [&](const Frame::Data& data) {
      const auto image = images.find(static_cast<image_t>(data.data_id));
      return data.sensor.type != SensorType::kCamera || image == images.end() ||
             image->second.camera_id != data.sensor.id;
    });
    if (complete.data.empty()) continue;
    if (!HasAllPoses(rig->second)) {
      result.num_images_of_unknown_rigs += complete.data.size();
      continue;
    }
    if (!scene.rigs.contains(frame.rig_id)) scene.rigs.Add(frame.rig_id, rig->second);
    for (const Frame::Data& data : complete.data)
      frame_of_image[static_cast<image_t>(data.data_id)] = frame_id;
    scene.unregistered_frames.Add(frame_id, std::move(complete));
  }
  scene.has_rig_files = std::any_of(scene.rigs.begin(), scene.rigs.end(),
                                    [](const auto& rig) { return !rig.second.sensors.empty(); });
  for (const auto& [id, of_database] : images) {
    if (!scene.cameras.contains(of_database.camera_id)) {
      throw InputError(database.path(),
                       fmt::format("image {} names camera {}, which is not there; write the images "
                                   "anew, or add the camera",
                                   id, of_database.camera_id));
    }
    Image image{.name = of_database.name, .camera_id = of_database.camera_id};
    const auto frame = frame_of_image.find(id);
    if (frame != frame_of_image.end()) image.frame_id = frame->second;
    if (const auto keypoints = database.ReadKeypoints(id)) {
      image.points2D.resize(keypoints->size());
      for (size_t i = 0; i < keypoints->size(); ++i) image.points2D[i].xy = keypoints->Position(i);
    }
    const auto found = features.find(id);
    if (found != features.end()) {
      for (const LineSegment2d& segment : found->second.segments)
        image.lines2D.push_back({segment, kNoId});
    }
    scene.unregistered_images.Add(id, std::move(image));
  }
  scene.AddTrivialRigsAndFrames();
  return result;
}

}  // namespace holba
