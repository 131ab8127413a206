// SPDX-License-Identifier: BSD-3-Clause
// Random consistent models for tests: every camera model, rigs of several sensors, every group
// type, names with blanks, reals of all magnitudes. Geometry is arbitrary: residuals mean nothing.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <limits>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "holba/base/check.h"
#include "holba/base/random.h"
#include "holba/scene/reconstruction.h"

namespace holba {

struct RandomModelOptions {
  bool with_rigs = true;           // rig files, two cameras and an IMU in a rig
  bool with_structure = true;      // lines, groups, wireframe, relations
  bool with_unregistered = false;  // images without a pose
  bool extreme_reals = true;       // some of -0, the least and the greatest numbers
};

namespace random_model_internal {

inline Eigen::Vector3d Vector(Random& random, double sigma = 3.0) {
  const double x = random.Normal(sigma), y = random.Normal(sigma), z = random.Normal(sigma);
  return {x, y, z};
}

inline Rigid3d Pose(Random& random) {
  Eigen::Quaterniond q(random.Normal(), random.Normal(), random.Normal(), random.Normal());
  return {q.normalized(), Vector(random)};
}

// Plain parameters of a valid group; of types that are not listed they are drawn until the type
// takes them.
inline std::vector<double> GroupParams(Random& random, const GroupType& type) {
  const Eigen::Vector3d u = Vector(random).normalized(), p = Vector(random), m = p.cross(u);
  const Eigen::Quaterniond q = Pose(random).rotation;
  const auto size = [&] { return random.Uniform(0.1, 3.0); };
  const std::map<std::string_view, std::vector<double>> known = {
      {"VP", {u.x(), u.y(), u.z()}},
      {"PLANE", {u.x(), u.y(), u.z(), random.Normal()}},
      {"SPHERE", {p.x(), p.y(), p.z(), size()}},
      {"CYLINDER", {u.x(), u.y(), u.z(), m.x(), m.y(), m.z(), size()}},
      {"CONE", {p.x(), p.y(), p.z(), u.x(), u.y(), u.z(), random.Uniform(0.1, 1.4)}},
      {"ELLIPSOID", {q.w(), q.x(), q.y(), q.z(), p.x(), p.y(), p.z(), size(), size(), size()}},
      {"CUBOID",
       {q.w(), q.x(), q.y(), q.z(), -size(), -size(), -size(), -size(), -size(), -size()}}};
  const auto found = known.find(type.name);
  if (found != known.end()) return found->second;
  for (int trial = 0; trial < 1000; ++trial) {
    std::vector<double> plain(type.num_file_params);
    for (double& x : plain) x = random.Normal();
    // A direction among them is one only where it is made unit.
    const size_t axis = type.file_params.find("dx dy dz");
    if (axis != std::string_view::npos) {
      const auto first = std::count(type.file_params.begin(), type.file_params.begin() + axis, ' ');
      std::copy_n(u.data(), 3, plain.begin() + first);
    }
    double g[kMaxGroupParams];
    if (type.from_file(plain.data(), g)) return plain;
  }
  HOLBA_CHECK_MSG(false, "add an example of this group type to random_model.h");
  return {};
}

// Makes one model, step by step.
class RandomModelMaker {
 public:
  RandomModelMaker(uint64_t seed, const RandomModelOptions& options)
      : options_(options), random_(seed) {}

  Reconstruction Make() {
    AddCameras();
    if (options_.with_rigs) {
      AddRigs();
    } else {
      for (image_t i = 0; i < 2 * kNumFrames; ++i)
        AddImage(100 - 7 * i, RandomCamera(), kInvalidId32);
      model_.AddTrivialRigsAndFrames();
    }
    if (options_.with_unregistered) AddUnregisteredImages();
    AddFeatures2D();
    AddFeatures3D();
    if (options_.with_structure) AddStructure();
    return std::move(model_);
  }

 private:
  static constexpr int kNumFrames = 4;
  static constexpr uint64_t kNumFeatures = 12;

  double Real() {
    constexpr double kExtremes[] = {-0.0,
                                    0.0,
                                    std::numeric_limits<double>::denorm_min(),
                                    -std::numeric_limits<double>::min(),
                                    std::numeric_limits<double>::max(),
                                    1.0 / 3.0,
                                    1e22,
                                    -123456789.0};
    if (options_.extreme_reals && random_.Index(20) == 0) return kExtremes[random_.Index(8)];
    return random_.Normal(1000.0);
  }
  Point2D RandomPoint2D() { return {.xy = {Real(), Real()}}; }
  Line2D RandomLine2D() { return {.segment = {{Real(), Real()}, {Real(), Real()}}}; }
  std::array<uint8_t, 3> Rgb() {
    return {static_cast<uint8_t>(random_.Index(256)), static_cast<uint8_t>(random_.Index(256)),
            255};
  }

  void AddCameras() {
    camera_t camera_id = 3;
    for (const CameraModel* camera_model : AllCameraModels()) {
      Camera camera{
          .model = camera_model, .width = random_.Index(5000), .height = 480, .params = {}};
      for (int i = 0; i < camera_model->num_params; ++i)
        camera.params.push_back(random_.Uniform(0.01, 900.0));
      model_.cameras.Add(camera_id, camera);
      camera_id += 1 + static_cast<camera_t>(random_.Index(5));
    }
  }
  camera_t RandomCamera() {
    return (model_.cameras.begin() + static_cast<long>(random_.Index(model_.cameras.size())))
        ->first;
  }

  void AddImage(image_t image_id, camera_t camera, frame_t frame_id) {
    constexpr const char* kNames[] = {"dir/image {}.jpg", "a  b {}.png", "{}", "\u00e9t\u00e9 {}"};
    std::string name = kNames[random_.Index(4)];
    name.replace(name.find("{}"), 2, std::to_string(image_id));
    model_.images.Add(image_id, {.name = name,
                                 .camera_id = camera,
                                 .frame_id = frame_id,
                                 .cam_from_world = Pose(random_),
                                 .points2D = {},
                                 .lines2D = {},
                                 .groups2D = {}});
  }

  void AddRigs() {
    model_.has_rig_files = true;
    const camera_t left = model_.cameras.begin()->first,
                   right = (model_.cameras.begin() + 1)->first;
    const SensorId imu{SensorType::kImu, 5};
    model_.rigs.Add(
        8, {.ref_sensor = SensorId{SensorType::kCamera, left},
            .sensors = {{.id = {SensorType::kCamera, right}, .sensor_from_rig = Pose(random_)},
                        {.id = imu, .sensor_from_rig = std::nullopt}}});
    model_.rigs.Add(2, {.ref_sensor = std::nullopt, .sensors = {}});
    for (frame_t i = 0; i < kNumFrames; ++i) {
      const frame_t frame_id = 40 - 3 * i;
      AddImage(10 * i + 2, right, frame_id);
      AddImage(10 * i + 1, left, frame_id);
      model_.frames.Add(frame_id,
                        {.rig_id = 8,
                         .rig_from_world = {},
                         .data = {{.sensor = {SensorType::kCamera, left}, .data_id = 10 * i + 1},
                                  {.sensor = {SensorType::kCamera, right}, .data_id = 10 * i + 2},
                                  {.sensor = imu, .data_id = uint64_t{1} << 40}}});
      model_.SetFramePose(frame_id, Pose(random_));
    }
  }

  void AddUnregisteredImages() {
    for (image_t image_id : {900, 901}) {
      Image image{.name = "waits " + std::to_string(image_id), .camera_id = RandomCamera()};
      for (size_t k = random_.Index(4); k > 0; --k) image.points2D.push_back(RandomPoint2D());
      if (options_.with_structure) {
        image.lines2D.push_back(RandomLine2D());
        image.groups2D.push_back({.type = FindGroupType("VP"), .line2D_idxs = {0}});
      }
      model_.AddUnregisteredImage(image_id, std::move(image));
    }
  }

  // The last image has none.
  void AddFeatures2D() {
    for (size_t i = 0; i + 1 < model_.images.size(); ++i) {
      Image& image = (model_.images.begin() + static_cast<long>(i))->second;
      for (size_t k = 5 + random_.Index(10); k > 0; --k) image.points2D.push_back(RandomPoint2D());
      for (size_t k = options_.with_structure ? 5 + random_.Index(10) : 0; k > 0; --k)
        image.lines2D.push_back(RandomLine2D());
    }
  }

  // Tracks take each 2D feature at most once.
  void AddFeatures3D() {
    for (uint64_t i = 0; i < kNumFeatures; ++i) {
      const uint64_t id = (i == 0 ? uint64_t{1} << 50 : 2 * i);
      Point3D point{.xyz = {Real(), Real(), Real()}, .rgb = Rgb(), .error = i == 3 ? -1.0 : Real()};
      Line3D line{.line = PlueckerLine::FromPointDirection(Vector(random_), Vector(random_)),
                  .start = Vector(random_),
                  .end = Vector(random_),
                  .rgb = Rgb(),
                  .error = random_.Normal()};
      for (auto& [image_id, image] : model_.images) {
        if (i % 4 == 3) break;  // features without a track
        if (random_.Index(2) == 0) continue;
        for (size_t k = random_.Index(10); k < image.points2D.size(); k += 7) {
          if (image.points2D[k].point3D_id != kNoId) continue;
          image.points2D[k].point3D_id = id;
          point.track.push_back({image_id, static_cast<point2D_t>(k)});
        }
        for (size_t k = random_.Index(10); k < image.lines2D.size(); k += 5) {
          if (image.lines2D[k].line3D_id != kNoId) continue;
          image.lines2D[k].line3D_id = id;
          line.track.push_back({image_id, static_cast<line2D_t>(k)});
        }
      }
      if (options_.with_structure) point.origin = static_cast<PointOrigin>(i % 4);
      model_.points3D.Add(id, point);
      if (options_.with_structure) model_.lines3D.Add(id, line);
    }
  }

  void AddStructure() {
    std::vector<group3D_t> directed;
    group3D_t group3D_id = 70;
    for (int round = 0; round < 2; ++round) {
      for (const GroupType* type : AllGroupTypes()) {
        group3D_id -= 3;
        AddGroup(group3D_id, *type);
        if (type->HasDirection()) directed.push_back(group3D_id);
      }
    }
    for (uint64_t i = 1; i < kNumFeatures; i += 2) model_.wireframe.push_back({2 * i, 2, i});
    for (size_t i = 1; i < directed.size(); ++i) {
      model_.relations.push_back(
          {directed[i - 1], directed[i],
           random_.Index(2) == 0 ? RelationType::kParallel : RelationType::kOrthogonal});
    }
  }

  void AddGroup(group3D_t group3D_id, const GroupType& type) {
    Group3D group{.type = &type, .params = GroupParams(random_, type)};
    for (uint64_t i = 1 + random_.Index(3); i < kNumFeatures; i += 1 + random_.Index(5)) {
      if (type.TakesPoints()) group.point3D_ids.push_back(2 * i);
      if (type.TakesLines()) group.line3D_ids.push_back(2 * i);
    }
    for (auto& [image_id, image] : model_.images) {
      if (image.points2D.empty() || random_.Index(2) == 0) continue;
      const bool is_observed = random_.Index(3) > 0;
      if (is_observed)
        group.observations.push_back({image_id, static_cast<group2D_t>(image.groups2D.size())});
      Group2D seen{.type = &type, .group3D_id = is_observed ? group3D_id : kNoId};
      for (uint32_t k = static_cast<uint32_t>(random_.Index(3)); k < 5; k += 2) {
        if (type.TakesPoints()) seen.point2D_idxs.push_back(k);
        if (type.TakesLines()) seen.line2D_idxs.push_back(k);
      }
      image.groups2D.push_back(seen);
    }
    model_.groups3D.Add(group3D_id, group);
  }

  const RandomModelOptions options_;
  Random random_;
  Reconstruction model_;
};

}  // namespace random_model_internal

inline Reconstruction RandomModel(uint64_t seed, const RandomModelOptions& options = {}) {
  return random_model_internal::RandomModelMaker(seed, options).Make();
}

}  // namespace holba
