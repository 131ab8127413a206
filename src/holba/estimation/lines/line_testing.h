// SPDX-License-Identifier: BSD-3-Clause
// A house of known edges before cameras, for tests of lines: exact or noisy segments, points on its
// faces, clutter.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cmath>
#include <cstdint>
#include <utility>
#include <vector>

#include "holba/base/random.h"
#include "holba/scene/ideal_view.h"
#include "holba/scene/image_features.h"
#include "holba/scene/reconstruction.h"

namespace holba {

using Edge3d = std::pair<Eigen::Vector3d, Eigen::Vector3d>;

struct TestHouse {
  Reconstruction model;
  ImageFeatureMap features;
  std::vector<Edge3d> edges;
  // Edge of each segment, -1: clutter; by image.
  std::map<image_t, std::vector<int>> edge_of_segment;
};

struct TestHouseOptions {
  double noise_px = 0.0;
  int num_clutter = 0;  // random segments in each image
  uint64_t seed = 1;
  const char* camera = "PINHOLE";
  std::vector<double> camera_params = {700.0, 700.0, 400.0, 300.0};
};

inline image_t AddCamera(const Eigen::Vector3d& centre, const Eigen::Vector3d& target,
                         TestHouse* house) {
  const image_t id = static_cast<image_t>(house->model.images.size()) + 1;
  Eigen::Matrix3d R;
  R.row(2) = (target - centre).normalized();
  R.row(0) = Eigen::Vector3d(0, 1, 0).cross(Eigen::Vector3d(R.row(2))).normalized();
  R.row(1) = Eigen::Vector3d(R.row(2)).cross(Eigen::Vector3d(R.row(0)));
  Image image;
  image.name = std::to_string(id) + ".png";
  image.camera_id = 1;
  image.cam_from_world.rotation = Eigen::Quaterniond(R);
  image.cam_from_world.translation = -(image.cam_from_world.rotation * centre);
  house->model.images.Add(id, std::move(image));
  return id;
}

// After the cameras: points, segments of the edges in all images, clutter.
inline void Observe(const TestHouseOptions& options, const std::vector<Eigen::Vector3d>& points,
                    TestHouse* house) {
  Random random(options.seed);
  for (size_t i = 0; i < points.size(); ++i) house->model.points3D.Add(i + 1, {.xyz = points[i]});
  for (auto& [image_id, image] : house->model.images) {
    const IdealView view(house->model, image_id);
    for (size_t i = 0; i < points.size(); ++i) {
      const auto ideal = view.Project(points[i]);
      const auto pixel = ideal ? view.ToPixel(*ideal) : std::nullopt;
      if (!pixel) continue;
      house->model.points3D.at(i + 1).track.push_back(
          {image_id, static_cast<point2D_t>(image.points2D.size())});
      image.points2D.push_back({*pixel, i + 1});
    }
    ImageFeatures& features = house->features[image_id];
    std::vector<int>& labels = house->edge_of_segment[image_id];
    const auto noisy = [&](const Eigen::Vector2d& x) {
      const double dx = random.Normal(options.noise_px), dy = random.Normal(options.noise_px);
      return Eigen::Vector2d(x.x() + dx, x.y() + dy);
    };
    for (size_t e = 0; e < house->edges.size(); ++e) {
      // A detector ends a little before the corner.
      const auto& [a, b] = house->edges[e];
      const auto start = view.Project(a + 0.02 * (b - a)), end = view.Project(b - 0.02 * (b - a));
      if (!start || !end) continue;
      const auto p = view.ToPixel(*start), q = view.ToPixel(*end);
      if (!p || !q) continue;
      features.segments.push_back({noisy(*p), noisy(*q)});
      labels.push_back(static_cast<int>(e));
    }
    for (int k = 0; k < options.num_clutter; ++k) {
      const Eigen::Vector2d start(random.Uniform(0, 800), random.Uniform(0, 600));
      const double angle = random.Uniform(0, 6.283), length = random.Uniform(10, 60);
      features.segments.push_back(
          {start, start + length * Eigen::Vector2d(std::cos(angle), std::sin(angle))});
      labels.push_back(-1);
    }
  }
  house->model.AddTrivialRigsAndFrames();
}

inline void AddTestCamera(const TestHouseOptions& options, TestHouse* house) {
  Camera camera;
  camera.model = FindCameraModel(options.camera);
  camera.width = 800;
  camera.height = 600;
  camera.params = options.camera_params;
  house->model.cameras.Add(1, camera);
}

// A box of 4 x 2 x 3 with a gable roof, seen by 8 cameras from two heights; 240 points.
inline TestHouse MakeTestHouse(const TestHouseOptions& options) {
  TestHouse house;
  AddTestCamera(options, &house);
  const auto corner = [](int x, int y, int z) {
    return Eigen::Vector3d(x ? 2 : -2, y ? 1 : -1, z ? 1.5 : -1.5);
  };
  for (int u = 0; u < 2; ++u) {
    for (int v = 0; v < 2; ++v) {
      house.edges.emplace_back(corner(0, u, v), corner(1, u, v));
      house.edges.emplace_back(corner(u, 0, v), corner(u, 1, v));
      house.edges.emplace_back(corner(u, v, 0), corner(u, v, 1));
    }
  }
  // y points down: the roof is at -1.
  const Eigen::Vector3d left(-2, -2.2, 0), right(2, -2.2, 0);
  house.edges.emplace_back(left, right);
  for (int z = 0; z < 2; ++z) {
    house.edges.emplace_back(corner(0, 0, z), left);
    house.edges.emplace_back(right, corner(1, 0, z));
  }
  for (int i = 0; i < 8; ++i) {
    const double angle = -0.7 + 0.2 * i;
    AddCamera(Eigen::Vector3d(9 * std::sin(angle), i % 2 ? -2.5 : 0.7, -9 * std::cos(angle)),
              Eigen::Vector3d(0, -0.3, 0), &house);
  }
  Random random(7);
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < 240; ++i) {
    Eigen::Vector3d X(random.Uniform(-2, 2), random.Uniform(-1, 1), random.Uniform(-1.5, 1.5));
    if (i % 2) {
      X.z() = -1.5;
    } else {
      X.x() = i % 4 ? 2.0 : -2.0;
    }
    points.push_back(X);
  }
  Observe(options, points, &house);
  return house;
}

// A facade z = 0 of windows (12 edges along x, 12 along y), cameras on a line along x before it:
// the edges along x lie in one plane with all cameras. 150 points on the facade.
inline TestHouse MakeTestFacade(const TestHouseOptions& options) {
  TestHouse house;
  AddTestCamera(options, &house);
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 2; ++j) {
      // No two edges are collinear.
      const double x = -2.4 + 1.9 * i + 0.13 * j, y = -1.2 + 1.5 * j + 0.11 * i, w = 1.1, h = 0.8;
      const Eigen::Vector3d a(x, y, 0), b(x + w, y, 0), c(x + w, y + h, 0), d(x, y + h, 0);
      house.edges.insert(house.edges.end(), {{a, b}, {b, c}, {c, d}, {d, a}});
    }
  }
  for (int i = 0; i < 7; ++i) {
    const Eigen::Vector3d centre(-2.1 + 0.7 * i, 0.05, -6.0);
    AddCamera(centre, centre + Eigen::Vector3d(0.02 * i, 0.03, 1), &house);
  }
  Random random(8);
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < 150; ++i)
    points.emplace_back(random.Uniform(-2.8, 2.8), random.Uniform(-1.6, 1.6), 0.0);
  Observe(options, points, &house);
  return house;
}

// The facade's plane (with all points) and the direction along x, as groups.
inline void AddFacadeGroups(TestHouse* house) {
  Group3D plane;
  plane.type = FindGroupType("PLANE");
  plane.params = {0, 0, 1, 0};
  for (const auto& [id, point] : house->model.points3D) plane.point3D_ids.push_back(id);
  house->model.groups3D.Add(1, plane);
  Group3D direction;
  direction.type = FindGroupType("VP");
  direction.params = {1, 0, 0};
  house->model.groups3D.Add(2, direction);
}

}  // namespace holba
