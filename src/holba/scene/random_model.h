// SPDX-License-Identifier: BSD-3-Clause
// Random consistent models for tests: every camera model, rigs of several sensors, every group
// type, names with blanks, reals of all magnitudes. Geometry is arbitrary: residuals mean nothing.
#pragma once

#include <cstdint>
#include <limits>
#include <map>
#include <string>
#include <vector>

#include "holba/base/check.h"
#include "holba/base/random.h"
#include "holba/scene/reconstruction.h"

namespace holba {

struct RandomModelOptions {
  bool with_rigs = true;       // rig files, two cameras and an IMU in a rig
  bool with_structure = true;  // lines, groups, wireframe, relations
  bool with_unregistered = false;  // images without a pose
  bool extreme_reals = true;   // some of -0, the least and the greatest numbers
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

// Plain parameters of a valid group; types that are not listed are fitted to a random minimal
// sample.
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
    std::vector<Eigen::Vector3d> points;
    std::vector<PlueckerLine> lines;
    for (int i = 0; i < type.min_points; ++i) points.push_back(Vector(random));
    for (int i = 0; points.empty() && i < type.min_lines; ++i) {
      lines.push_back(PlueckerLine::FromPointDirection(Vector(random), Vector(random)));
    }
    double g[kMaxGroupParams];
    if (!type.fit_minimal(points, lines, g)) continue;
    std::vector<double> plain(type.num_file_params);
    type.to_file(g, plain.data());
    return plain;
  }
  HOLBA_CHECK_MSG(false, "add an example of this group type to random_model.h");
  return {};
}

}  // namespace random_model_internal

inline Reconstruction RandomModel(uint64_t seed, const RandomModelOptions& options = {}) {
  using namespace random_model_internal;
  Random random(seed);
  Reconstruction model;
  const auto real = [&] {
    constexpr double kExtremes[] = {-0.0,
                                    0.0,
                                    std::numeric_limits<double>::denorm_min(),
                                    -std::numeric_limits<double>::min(),
                                    std::numeric_limits<double>::max(),
                                    1.0 / 3.0,
                                    1e22,
                                    -123456789.0};
    if (options.extreme_reals && random.Index(20) == 0) return kExtremes[random.Index(8)];
    return random.Normal(1000.0);
  };

  camera_t camera_id = 3;
  for (const CameraModel* camera_model : AllCameraModels()) {
    Camera camera{.model = camera_model, .width = random.Index(5000), .height = 480, .params = {}};
    for (int i = 0; i < camera_model->num_params; ++i) {
      camera.params.push_back(random.Uniform(0.01, 900.0));
    }
    model.cameras.Add(camera_id, camera);
    camera_id += 1 + static_cast<camera_t>(random.Index(5));
  }
  const auto random_camera = [&] {
    return (model.cameras.begin() + static_cast<long>(random.Index(model.cameras.size())))->first;
  };
  constexpr int kNumFrames = 4;
  const auto add_image = [&](image_t image_id, camera_t camera, frame_t frame_id) {
    constexpr const char* kNames[] = {"dir/image {}.jpg", "a  b {}.png", "{}", "\u00e9t\u00e9 {}"};
    std::string name = kNames[random.Index(4)];
    name.replace(name.find("{}"), 2, std::to_string(image_id));
    model.images.Add(image_id, {.name = name,
                                .camera_id = camera,
                                .frame_id = frame_id,
                                .cam_from_world = Pose(random),
                                .points2D = {},
                                .lines2D = {},
                                .groups2D = {}});
  };
  if (options.with_rigs) {
    model.has_rig_files = true;
    const camera_t left = model.cameras.begin()->first, right = (model.cameras.begin() + 1)->first;
    const SensorId imu{SensorType::kImu, 5};
    model.rigs.Add(
        8, {.ref_sensor = SensorId{SensorType::kCamera, left},
            .sensors = {{.id = {SensorType::kCamera, right}, .sensor_from_rig = Pose(random)},
                        {.id = imu, .sensor_from_rig = std::nullopt}}});
    model.rigs.Add(2, {.ref_sensor = std::nullopt, .sensors = {}});
    for (frame_t i = 0; i < kNumFrames; ++i) {
      const frame_t frame_id = 40 - 3 * i;
      add_image(10 * i + 2, right, frame_id);
      add_image(10 * i + 1, left, frame_id);
      model.frames.Add(frame_id,
                       {.rig_id = 8,
                        .rig_from_world = {},
                        .data = {{.sensor = {SensorType::kCamera, left}, .data_id = 10 * i + 1},
                                 {.sensor = {SensorType::kCamera, right}, .data_id = 10 * i + 2},
                                 {.sensor = imu, .data_id = uint64_t{1} << 40}}});
      model.SetFramePose(frame_id, Pose(random));
    }
  } else {
    for (image_t i = 0; i < 2 * kNumFrames; ++i)
      add_image(100 - 7 * i, random_camera(), kInvalidId32);
    model.AddTrivialRigsAndFrames();
  }

  if (options.with_unregistered) {
    for (image_t image_id : {900, 901}) {
      Image image{.name = "waits " + std::to_string(image_id), .camera_id = random_camera()};
      for (size_t k = random.Index(4); k > 0; --k) image.points2D.push_back({.xy = {real(), real()}});
      if (options.with_structure) {
        image.lines2D.push_back({.segment = {{real(), real()}, {real(), real()}}});
        image.groups2D.push_back({.type = FindGroupType("VP"), .line2D_idxs = {0}});
      }
      model.AddUnregisteredImage(image_id, std::move(image));
    }
  }

  // 2D features, then tracks that take each of them at most once; the last image has none.
  for (size_t i = 0; i + 1 < model.images.size(); ++i) {
    Image& image = (model.images.begin() + static_cast<long>(i))->second;
    for (size_t k = 5 + random.Index(10); k > 0; --k)
      image.points2D.push_back({.xy = {real(), real()}});
    for (size_t k = options.with_structure ? 5 + random.Index(10) : 0; k > 0; --k) {
      image.lines2D.push_back({.segment = {{real(), real()}, {real(), real()}}});
    }
  }
  constexpr uint64_t kNumFeatures = 12;
  const auto rgb = [&] {
    return std::array<uint8_t, 3>{static_cast<uint8_t>(random.Index(256)),
                                  static_cast<uint8_t>(random.Index(256)), 255};
  };
  for (uint64_t i = 0; i < kNumFeatures; ++i) {
    const uint64_t id = (i == 0 ? uint64_t{1} << 50 : 2 * i);
    Point3D point{.xyz = {real(), real(), real()}, .rgb = rgb(), .error = i == 3 ? -1.0 : real()};
    Line3D line{.line = PlueckerLine::FromPointDirection(Vector(random), Vector(random)),
                .start = Vector(random),
                .end = Vector(random),
                .rgb = rgb(),
                .error = random.Normal()};
    for (auto& [image_id, image] : model.images) {
      if (i % 4 == 3) break;  // features without a track
      if (random.Index(2) == 0) continue;
      for (size_t k = random.Index(10); k < image.points2D.size(); k += 7) {
        if (image.points2D[k].point3D_id != kNoId) continue;
        image.points2D[k].point3D_id = id;
        point.track.push_back({image_id, static_cast<point2D_t>(k)});
      }
      for (size_t k = random.Index(10); k < image.lines2D.size(); k += 5) {
        if (image.lines2D[k].line3D_id != kNoId) continue;
        image.lines2D[k].line3D_id = id;
        line.track.push_back({image_id, static_cast<line2D_t>(k)});
      }
    }
    if (options.with_structure) point.origin = static_cast<PointOrigin>(i % 4);
    model.points3D.Add(id, point);
    if (options.with_structure) model.lines3D.Add(id, line);
  }
  if (!options.with_structure) return model;

  std::vector<group3D_t> directed;
  group3D_t group3D_id = 70;
  for (int round = 0; round < 2; ++round) {
    for (const GroupType* type : AllGroupTypes()) {
      group3D_id -= 3;
      Group3D group{.type = type, .params = GroupParams(random, *type)};
      for (uint64_t i = 1 + random.Index(3); i < kNumFeatures; i += 1 + random.Index(5)) {
        if (type->TakesPoints()) group.point3D_ids.push_back(2 * i);
        if (type->TakesLines()) group.line3D_ids.push_back(2 * i);
      }
      for (auto& [image_id, image] : model.images) {
        if (image.points2D.empty() || random.Index(2) == 0) continue;
        const bool is_observed = random.Index(3) > 0;
        if (is_observed) {
          group.observations.push_back({image_id, static_cast<group2D_t>(image.groups2D.size())});
        }
        Group2D seen{.type = type, .group3D_id = is_observed ? group3D_id : kNoId};
        for (uint32_t k = static_cast<uint32_t>(random.Index(3)); k < 5; k += 2) {
          if (type->TakesPoints()) seen.point2D_idxs.push_back(k);
          if (type->TakesLines()) seen.line2D_idxs.push_back(k);
        }
        image.groups2D.push_back(seen);
      }
      model.groups3D.Add(group3D_id, group);
      if (type->HasDirection()) directed.push_back(group3D_id);
    }
  }
  for (uint64_t i = 1; i < kNumFeatures; i += 2) model.wireframe.push_back({2 * i, 2, i});
  for (size_t i = 1; i < directed.size(); ++i) {
    model.relations.push_back(
        {directed[i - 1], directed[i],
         random.Index(2) == 0 ? RelationType::kParallel : RelationType::kOrthogonal});
  }
  return model;
}

}  // namespace holba
