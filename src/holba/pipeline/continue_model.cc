// SPDX-License-Identifier: BSD-3-Clause
#include "holba/pipeline/continue_model.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <set>
#include <string_view>
#include <utility>
#include <vector>

#include "holba/base/error.h"
#include "holba/base/words.h"
#include "holba/scene/name_pairing.h"

namespace holba {
namespace {

// Databases have single precision, and programs that read them round no further.
constexpr double kSamePlacePx = 0.01;

constexpr const char* kGiveItsDatabase =
    "give its database, with the new images added to it (--database_path)";

class Continuer {
 public:
  Continuer(const Reconstruction& model, const std::filesystem::path& model_path,
            Reconstruction* scene)
      : model_(model), path_(model_path), scene_(*scene) {}

  ContinueReport Run() {
    PairImages();
    TakeCameras();
    TakePoses();
    PairKeypoints();
    TakePoints();
    report_.num_lines_and_groups_left_out += model_.lines3D.size() + model_.groups3D.size();
    return report_;
  }

 private:
  void PairImages() {
    std::vector<image_t> model_ids, scene_ids;
    std::vector<std::string_view> model_names, scene_names;
    for (const auto& [id, image] : model_.images) {
      model_ids.push_back(id);
      model_names.push_back(image.name);
    }
    for (const auto& [id, image] : scene_.unregistered_images) {
      scene_ids.push_back(id);
      scene_names.push_back(image.name);
    }
    const NamePairing pairing = PairNames(model_names, scene_names);
    size_t num_missing = 0;
    std::string_view first_missing;
    for (size_t i = 0; i < model_ids.size(); ++i) {
      if (pairing.b_of_a[i]) {
        scene_id_[model_ids[i]] = scene_ids[*pairing.b_of_a[i]];
      } else if (++num_missing == 1) {
        first_missing = model_names[i];
      }
    }
    if (num_missing > 0) {
      throw InputError(
          path_, fmt::format("{} of its {} are not in the database (first '{}'); {}", num_missing,
                             Counted(model_ids.size(), "image"), first_missing, kGiveItsDatabase));
    }
    report_.num_images = model_ids.size();
  }

  // The camera of the scene's images becomes the model's, so that new images of the same camera
  // have it, too; where the model has several for one of the scene, each gets a place of its own.
  void TakeCameras() {
    std::map<camera_t, std::set<camera_t>> of_scene_camera;
    for (const auto& [id, image] : model_.images) {
      const Image& in_scene = SceneImage(id);
      const Camera& before = scene_.cameras.at(in_scene.camera_id);
      const Camera& camera = model_.cameras.at(image.camera_id);
      if (before.width != camera.width || before.height != camera.height) {
        throw InputError(
            path_,
            fmt::format("image '{}': expected {} x {} pixels, as the database has it, found "
                        "{} x {}",
                        image.name, before.width, before.height, camera.width, camera.height));
      }
      of_scene_camera[in_scene.camera_id].insert(image.camera_id);
    }
    std::map<std::pair<camera_t, camera_t>, camera_t> new_camera;
    for (const auto& [scene_camera, model_cameras] : of_scene_camera) {
      for (const camera_t model_camera : model_cameras) {
        const bool is_first = model_camera == *model_cameras.begin();
        const camera_t id = is_first ? scene_camera : scene_.cameras.NextId();
        if (is_first) {
          scene_.cameras.at(id) = model_.cameras.at(model_camera);
          continue;
        }
        scene_.cameras.Add(id, model_.cameras.at(model_camera));
        new_camera[{scene_camera, model_camera}] = id;
      }
    }
    for (const auto& [id, image] : model_.images) {
      Image& in_scene = SceneImage(id);
      const auto found = new_camera.find({in_scene.camera_id, image.camera_id});
      if (found != new_camera.end()) GiveCamera(found->second, scene_id_.at(id), &in_scene);
    }
  }

  // A camera of its own goes with a rig and a frame of its own.
  void GiveCamera(camera_t camera_id, image_t image_id, Image* image) {
    image->camera_id = camera_id;
    Frame& frame = scene_.unregistered_frames.at(image->frame_id);
    if (scene_.rigs.at(frame.rig_id).sensors.empty() && frame.data.size() == 1) {
      Rig rig;
      rig.ref_sensor = SensorId{SensorType::kCamera, camera_id};
      frame.rig_id = scene_.rigs.NextId();
      scene_.rigs.Add(frame.rig_id, rig);
      frame.data = {{*rig.ref_sensor, image_id}};
      return;
    }
    throw InputError(path_,
                     fmt::format("image '{}' is of a rig in the database and has a camera of "
                                 "its own in the model; {}",
                                 image->name, kGiveItsDatabase));
  }

  void TakePoses() {
    // Sensors of rigs that both have are where the model has adjusted them to.
    std::map<frame_t, image_t> image_of_frame;  // of the model; the reference sensor's, if there is
    for (const auto& [id, image] : model_.images) {
      const Image& in_scene = SceneImage(id);
      Rig& rig = scene_.rigs.at(scene_.unregistered_frames.at(in_scene.frame_id).rig_id);
      const SensorId sensor{SensorType::kCamera, in_scene.camera_id};
      if (rig.ref_sensor == sensor) {
        image_of_frame[in_scene.frame_id] = id;
        continue;
      }
      image_of_frame.emplace(in_scene.frame_id, id);
      const Rig& of_model = model_.rigs.at(model_.frames.at(image.frame_id).rig_id);
      if (of_model.sensors.size() != rig.sensors.size()) continue;
      for (Rig::Sensor& of_rig : rig.sensors) {
        if (of_rig.id == sensor) of_rig.sensor_from_rig = model_.SensorFromRig(image);
      }
    }
    for (const auto& [frame_id, model_image] : image_of_frame) {
      const Rigid3d& pose = model_.images.at(model_image).cam_from_world;
      const Image& in_scene = SceneImage(model_image);
      const Rigid3d& sensor_from_rig = scene_.SensorFromRig(in_scene);
      const bool is_reference =
          sensor_from_rig.translation.isZero(0.0) &&
          sensor_from_rig.rotation.coeffs() == Eigen::Quaterniond::Identity().coeffs();
      // Without rounding, where the frame's pose is the image's.
      scene_.RegisterFrame(frame_id, is_reference ? pose : sensor_from_rig.Inverse() * pose);
    }
  }

  void PairKeypoints() {
    size_t num_points = 0, num_found = 0;
    for (const auto& [id, image] : model_.images) {
      const Image& in_scene = SceneImage(id);
      std::vector<point2D_t>& idxs = scene_idx_[id];
      idxs.assign(image.points2D.size(), kInvalidId32);
      std::map<std::pair<int64_t, int64_t>, std::vector<point2D_t>> cells;  // of a pixel, if needed
      for (point2D_t idx = 0; idx < image.points2D.size(); ++idx) {
        const Eigen::Vector2d& xy = image.points2D[idx].xy;
        ++num_points;
        if (idx < in_scene.points2D.size() &&
            (in_scene.points2D[idx].xy - xy).norm() <= kSamePlacePx) {
          idxs[idx] = idx;
        } else {
          if (cells.empty()) cells = CellsOf(in_scene);
          idxs[idx] = NearestIn(cells, in_scene, xy);
        }
        num_found += idxs[idx] != kInvalidId32;
      }
    }
    if (num_points > 0 && num_found == 0) {
      throw InputError(path_, fmt::format("none of its 2D points is a keypoint of the database; {}",
                                          kGiveItsDatabase));
    }
  }

  using Cells = std::map<std::pair<int64_t, int64_t>, std::vector<point2D_t>>;
  static std::pair<int64_t, int64_t> CellOf(const Eigen::Vector2d& xy) {
    return {static_cast<int64_t>(std::floor(xy.x())), static_cast<int64_t>(std::floor(xy.y()))};
  }
  static Cells CellsOf(const Image& image) {
    Cells cells;
    for (point2D_t idx = 0; idx < image.points2D.size(); ++idx)
      cells[CellOf(image.points2D[idx].xy)].push_back(idx);
    return cells;
  }
  // The first keypoint at the place; several may be there, with other directions.
  static point2D_t NearestIn(const Cells& cells, const Image& image, const Eigen::Vector2d& xy) {
    const auto [column, row] = CellOf(xy);
    point2D_t nearest = kInvalidId32;
    double least = kSamePlacePx;
    for (int64_t i = column - 1; i <= column + 1; ++i) {
      for (int64_t j = row - 1; j <= row + 1; ++j) {
        const auto cell = cells.find({i, j});
        if (cell == cells.end()) continue;
        for (const point2D_t idx : cell->second) {
          const double distance = (image.points2D[idx].xy - xy).norm();
          if (distance < least || (distance == least && idx < nearest)) {
            least = distance;
            nearest = idx;
          }
        }
      }
    }
    return nearest;
  }

  void TakePoints() {
    for (const auto& [id, point] : model_.points3D) {
      if (IsOfStructure(point.origin)) {
        ++report_.num_lines_and_groups_left_out;
        continue;
      }
      Point3D taken = point;
      taken.track.clear();
      for (const PointObservation& observation : point.track) {
        const point2D_t idx = scene_idx_.at(observation.image_id)[observation.point2D_idx];
        const image_t image_id = scene_id_.at(observation.image_id);
        const PointObservation of_scene{image_id, idx};
        if (idx == kInvalidId32 || scene_.images.at(image_id).points2D[idx].point3D_id != kNoId ||
            std::find(taken.track.begin(), taken.track.end(), of_scene) != taken.track.end()) {
          ++report_.num_foreign_observations;
          continue;
        }
        taken.track.push_back(of_scene);
      }
      if (taken.track.size() < 2) {
        ++report_.num_points_left_out;
        continue;
      }
      for (const PointObservation& observation : taken.track)
        scene_.images.at(observation.image_id).points2D[observation.point2D_idx].point3D_id = id;
      report_.num_observations += taken.track.size();
      ++report_.num_points;
      scene_.points3D.Add(id, std::move(taken));
    }
  }

  Image& SceneImage(image_t model_id) { return *scene_.FindImage(scene_id_.at(model_id)); }

  const Reconstruction& model_;
  const std::filesystem::path& path_;
  Reconstruction& scene_;
  std::map<image_t, image_t> scene_id_;                  // by the id in the model
  std::map<image_t, std::vector<point2D_t>> scene_idx_;  // of each 2D point of the model's image
  ContinueReport report_;
};

}  // namespace

ContinueReport ContinueModel(const Reconstruction& model, const std::filesystem::path& model_path,
                             Reconstruction* scene) {
  return Continuer(model, model_path, scene).Run();
}

}  // namespace holba
