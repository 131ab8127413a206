// SPDX-License-Identifier: BSD-3-Clause
// A posed model's cameras and images in a Database, and the rigs and frames they belong to.
#include <algorithm>
#include <set>

#include "holba/base/check.h"
#include "holba/base/error.h"
#include "holba/io/database_statement.h"

namespace holba {
namespace {

bool SameCamera(const Camera& a, const Camera& b) {
  return a.model == b.model && a.width == b.width && a.height == b.height && a.params == b.params;
}

Keypoints ToKeypoints(const std::vector<Point2D>& points2D) {
  Keypoints keypoints;
  for (const Point2D& point : points2D) keypoints.Add(point.xy);
  return keypoints;
}

}  // namespace

std::optional<rig_t> Database::FindRigOfCamera(camera_t camera_id) const {
  Statement row(*this,
                "SELECT rig_id FROM rigs WHERE ref_sensor_id = ?1 AND ref_sensor_type = ?2 UNION "
                "SELECT rig_id FROM rig_sensors WHERE sensor_id = ?1 AND sensor_type = ?2");
  if (!row.Integer(camera_id).Integer(kDatabaseCamera).Step()) return std::nullopt;
  return static_cast<rig_t>(row.GetInteger(0));
}

rig_t Database::RigOfCamera(camera_t camera_id) {
  if (const std::optional<rig_t> rig_id = FindRigOfCamera(camera_id)) return *rig_id;
  Statement(*this, "INSERT INTO rigs(ref_sensor_id, ref_sensor_type) VALUES(?, ?)")
      .Integer(camera_id)
      .Integer(kDatabaseCamera)
      .Run();
  return static_cast<rig_t>(sqlite3_last_insert_rowid(handle_));
}

bool Database::EveryImageHasAFrame() const {
  if (!has_rigs_) return false;
  Statement missing(*this,
                    "SELECT image_id FROM images WHERE image_id NOT IN (SELECT data_id FROM "
                    "frame_data WHERE sensor_type = ?)");
  return !missing.Integer(kDatabaseCamera).Step();
}

void Database::AddFrame(const std::vector<std::pair<image_t, camera_t>>& images) {
  std::map<rig_t, std::vector<std::pair<image_t, camera_t>>> by_rig;
  for (const auto& image : images) by_rig[RigOfCamera(image.second)].push_back(image);
  for (const auto& [rig_id, of_rig] : by_rig) {
    Statement(*this, "INSERT INTO frames(rig_id) VALUES(?)").Integer(rig_id).Run();
    const int64_t frame_id = sqlite3_last_insert_rowid(handle_);
    for (const auto& [image_id, camera_id] : of_rig) {
      Statement(*this,
                "INSERT INTO frame_data(frame_id, data_id, sensor_id, sensor_type) "
                "VALUES(?, ?, ?, ?)")
          .Integer(frame_id)
          .Integer(image_id)
          .Integer(camera_id)
          .Integer(kDatabaseCamera)
          .Run();
    }
  }
}

void Database::AddRig(const Rig& rig, const std::map<camera_t, camera_t>& database_camera) {
  if (!rig.ref_sensor) return;
  std::vector<Rig::Sensor> sensors = {{*rig.ref_sensor, std::nullopt}};
  sensors.insert(sensors.end(), rig.sensors.begin(), rig.sensors.end());
  for (Rig::Sensor& sensor : sensors) {
    if (sensor.id.type != SensorType::kCamera) continue;
    const auto camera = database_camera.find(sensor.id.id);
    if (camera == database_camera.end()) return;
    sensor.id.id = camera->second;
    // A sensor is in one rig: the database's own stays.
    if (FindRigOfCamera(sensor.id.id)) return;
  }
  Statement(*this, "INSERT INTO rigs(ref_sensor_id, ref_sensor_type) VALUES(?, ?)")
      .Integer(sensors[0].id.id)
      .Integer(static_cast<int>(sensors[0].id.type))
      .Run();
  const int64_t rig_id = sqlite3_last_insert_rowid(handle_);
  for (size_t i = 1; i < sensors.size(); ++i) {
    std::optional<std::vector<double>> pose;
    if (sensors[i].sensor_from_rig) {
      const Eigen::Quaterniond q = sensors[i].sensor_from_rig->rotation.normalized();
      const Eigen::Vector3d& t = sensors[i].sensor_from_rig->translation;
      pose = {q.w(), q.x(), q.y(), q.z(), t.x(), t.y(), t.z()};
    }
    Statement(*this,
              "INSERT INTO rig_sensors(rig_id, sensor_id, sensor_type, sensor_from_rig) "
              "VALUES(?, ?, ?, ?)")
        .Integer(rig_id)
        .Integer(sensors[i].id.id)
        .Integer(static_cast<int>(sensors[i].id.type))
        .Bytes(pose)
        .Run();
  }
}

std::map<camera_t, camera_t> Database::MatchCameras(
    const Reconstruction& model, const std::map<image_t, image_t>& known,
    const std::map<image_t, DatabaseImage>& images) {
  std::map<camera_t, camera_t> database_camera;
  const std::map<camera_t, DatabaseCamera> cameras = ReadCameras();
  // What one image says holds for the other images of the camera.
  for (const auto& [image_id, image] : model.images) {
    const auto found = known.find(image_id);
    if (found == known.end()) continue;
    const camera_t camera_id = images.at(found->second).camera_id;
    database_camera.emplace(image.camera_id, camera_id);
    const auto camera = cameras.find(camera_id);
    if (camera == cameras.end()) {
      FailRow("images", fmt::format("image_id = {}", found->second),
              fmt::format("there is no camera {}", camera_id));
    }
    const Camera &ours = camera->second.camera, &given = model.cameras.at(image.camera_id);
    if (ours.width != given.width || ours.height != given.height) {
      throw InputError(path_,
                       fmt::format("image '{}' has {} x {} pixels here and {} x {} in the "
                                   "model; give the database that the model was made from",
                                   image.name, ours.width, ours.height, given.width, given.height));
    }
  }
  std::set<camera_t> needed;
  for (const auto& [image_id, image] : model.images) {
    if (!known.contains(image_id)) needed.insert(image.camera_id);
  }
  // Two passes, so that a new id is not one that another camera of the model has.
  for (const bool with_model_id : {true, false}) {
    for (const auto& [camera_id, camera] : model.cameras) {
      if (!needed.contains(camera_id) || database_camera.contains(camera_id)) continue;
      const auto same_id = cameras.find(camera_id);
      if (with_model_id && same_id != cameras.end()) {
        if (SameCamera(same_id->second.camera, camera)) database_camera[camera_id] = camera_id;
      } else {
        const auto id = with_model_id ? std::optional(camera_id) : std::nullopt;
        database_camera[camera_id] = AddCamera(id, {camera, true});
      }
    }
  }
  return database_camera;
}

std::map<image_t, image_t> Database::MatchImages(const Reconstruction& model,
                                                 const std::map<std::string, std::string>& names) {
  Transaction transaction(this);
  const std::map<image_t, DatabaseImage> images = ReadImages();
  std::map<std::string, image_t> ids_by_name;
  for (const auto& [image_id, image] : images) ids_by_name.emplace(image.name, image_id);
  std::map<image_t, image_t> database_image;  // of those that the database has
  for (const auto& [image_id, image] : model.images) {
    const auto name = names.find(image.name);
    const auto found = ids_by_name.find(name != names.end() ? name->second : image.name);
    if (found != ids_by_name.end()) database_image.emplace(image_id, found->second);
  }
  const std::map<camera_t, camera_t> database_camera = MatchCameras(model, database_image, images);
  const bool keeps_frames = EveryImageHasAFrame();
  if (keeps_frames) {
    for (const auto& [rig_id, rig] : model.rigs) AddRig(rig, database_camera);
  }

  std::map<frame_t, std::vector<std::pair<image_t, camera_t>>> new_images;
  for (const bool with_model_id : {true, false}) {
    for (const auto& [image_id, image] : model.images) {
      if (database_image.contains(image_id)) continue;

      const bool id_is_free = image_id < kMaxNumImages && !images.contains(image_id);
      if (with_model_id && !id_is_free) continue;
      const camera_t camera_id = database_camera.at(image.camera_id);
      const image_t added = InsertImage(with_model_id ? std::optional(image_id) : std::nullopt,
                                        {image.name, camera_id});
      database_image[image_id] = added;

      new_images[image.frame_id].emplace_back(added, camera_id);
    }
  }
  if (keeps_frames) {
    for (const auto& [frame_id, of_frame] : new_images) AddFrame(of_frame);
  }

  for (const auto& [image_id, image] : model.images) {
    const image_t id = database_image.at(image_id);
    if (NumRows("keypoints", id).value_or(0) > 0 || image.points2D.empty()) continue;
    WriteKeypoints(id, ToKeypoints(image.points2D));
    // Without a row COLMAP would describe its own keypoints and leave these.
    WriteDescriptors(id, {});
  }
  transaction.Commit();
  return database_image;
}

}  // namespace holba
