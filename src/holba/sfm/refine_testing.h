// SPDX-License-Identifier: BSD-3-Clause
// A house of known walls, windows and corners as noisy features of photographs, for tests of
// structure and of the whole refinement.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <map>
#include <set>
#include <vector>

#include "holba/base/random.h"
#include "holba/estimation/directions/vanishing_points.h"
#include "holba/estimation/lines/line_testing.h"
#include "holba/geometry/angle.h"

namespace holba {

struct RefineScene {
  TestHouse house;  // with the true poses
  // Planes as n.x + w = 0: front, side, ground.
  std::array<Eigen::Vector4d, 3> planes;
  std::vector<Eigen::Vector3d> window_corners;   // each the end of two edges
  LineMatchMap matches;                          // the right ones, and as many wrong ones
  Eigen::Vector4d sphere{-2.9, -1.2, 0.2, 0.5};  // centre, radius
  std::set<point3D_t> sphere_points, near_front;
};

struct RefineSceneOptions {
  double noise_px = 0.3;   // of points, corners and ends of segments
  int num_clutter = 30;    // random segments, and random corners, in each image
  int num_near_front = 0;  // points 0.04 (3 px) before the front
};

// Front (z = -1.5) with 6 windows, side (x = 2) with 4, ground (y = 1) with 2 slabs, seen by 8
// cameras; 90 points on each, 40 on a sphere, 40 anywhere.
inline RefineScene MakeRefineScene(const RefineSceneOptions& options) {
  RefineScene scene;
  TestHouse& house = scene.house;
  AddTestCamera({.camera = "SIMPLE_RADIAL", .camera_params = {700.0, 400.0, 300.0, -0.05}}, &house);
  scene.planes = {Eigen::Vector4d(0, 0, 1, 1.5), {1, 0, 0, -2}, {0, 1, 0, -1}};
  // Origin and two directions of each plane, and the extent along them.
  struct Wall {
    Eigen::Vector3d origin, u, v;
    double width, height;
  };
  const Wall walls[3] = {{{-2, -1, -1.5}, {1, 0, 0}, {0, 1, 0}, 4, 2},
                         {{2, -1, -1.5}, {0, 0, 1}, {0, 1, 0}, 3, 2},
                         {{-2, 1, -3.5}, {1, 0, 0}, {0, 0, 1}, 4, 1.9}};
  const auto add_window = [&](const Wall& wall, double a, double b, double w, double h) {
    const auto at = [&](double s, double t) {
      return Eigen::Vector3d(wall.origin + s * wall.u + t * wall.v);
    };
    const Eigen::Vector3d c[4] = {at(a, b), at(a + w, b), at(a + w, b + h), at(a, b + h)};
    for (int i = 0; i < 4; ++i) {
      house.edges.emplace_back(c[i], c[(i + 1) % 4]);
      scene.window_corners.push_back(c[i]);
    }
  };
  // No two edges are collinear.
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 2; ++j)
      add_window(walls[0], 0.25 + 1.27 * i + 0.07 * j, 0.2 + 0.9 * j + 0.06 * i, 0.8, 0.55);
  }
  for (int i = 0; i < 2; ++i) {
    for (int j = 0; j < 2; ++j)
      add_window(walls[1], 0.3 + 1.35 * i + 0.05 * j, 0.15 + 0.9 * j + 0.08 * i, 0.85, 0.6);
    add_window(walls[2], 0.4 + 1.75 * i, 0.35 + 0.13 * i, 1.2, 0.9);
  }
  for (int i = 0; i < 8; ++i) {
    const double angle = 0.25 + 0.12 * i;
    AddCamera(Eigen::Vector3d(9 * std::sin(angle), i % 2 ? -2.8 : -0.9, -9 * std::cos(angle)),
              Eigen::Vector3d(0.3, 0, -0.5), &house);
  }
  Random random(7);
  std::vector<Eigen::Vector3d> points;
  for (const Wall& wall : walls) {
    for (int i = 0; i < 90; ++i) {
      const double s = random.Uniform(0, wall.width), t = random.Uniform(0, wall.height);
      points.push_back(wall.origin + s * wall.u + t * wall.v);
    }
  }
  for (int i = 0; i < 40; ++i) {
    const double x = random.Normal(), y = random.Normal();
    const Eigen::Vector3d normal = Eigen::Vector3d(x, y, random.Normal()).normalized();
    points.push_back(scene.sphere.head<3>() + scene.sphere[3] * normal);
    scene.sphere_points.insert(points.size());
  }
  for (int i = 0; i < 40; ++i) {
    const double x = random.Uniform(-3, 3), y = random.Uniform(-2.5, 0.5);
    points.emplace_back(x, y, random.Uniform(-3.5, 2.5));
  }
  for (int i = 0; i < options.num_near_front; ++i) {
    const double x = random.Uniform(-1.8, 1.8);
    points.emplace_back(x, random.Uniform(-0.9, 0.9), -1.54);
    scene.near_front.insert(points.size());
  }
  Observe({.noise_px = options.noise_px, .num_clutter = options.num_clutter}, points, &house);

  for (auto& [image_id, image] : house.model.images) {
    const IdealView view(house.model, image_id);
    const auto noisy = [&](const Eigen::Vector2d& x) {
      const double dx = random.Normal(options.noise_px), dy = random.Normal(options.noise_px);
      return Eigen::Vector2d(x.x() + dx, x.y() + dy);
    };
    for (Point2D& point : image.points2D) point.xy = noisy(point.xy);
    ImageFeatures& features = house.features.at(image_id);
    const auto add_corner = [&](const Eigen::Vector2d& pixel, uint64_t look) {
      features.corners.push_back(pixel);
      Random bytes(look);
      for (int k = 0; k < kCornerDescriptorSize; ++k)
        features.corner_descriptors.push_back(static_cast<uint8_t>(bytes.Index(80)));
    };
    for (size_t i = 0; i < scene.window_corners.size(); ++i) {
      const auto ideal = view.Project(scene.window_corners[i]);
      const auto pixel = ideal ? view.ToPixel(*ideal) : std::nullopt;
      if (pixel) add_corner(noisy(*pixel), 1000 + i);
    }
    for (int i = 0; i < options.num_clutter; ++i)
      add_corner({random.Uniform(0, 800), random.Uniform(0, 600)}, random.Bits());

    std::vector<LineSegment2d> ideal;
    for (const LineSegment2d& segment : features.segments)
      ideal.push_back(view.ToIdeal(segment).value());
    VanishingPoints vps = DetectVanishingPoints({}, ideal, view.K());
    features.vanishing_points = std::move(vps.points);
    features.vp_of_segment = std::move(vps.vp_of_segment);
  }

  for (const auto& [id1, edges1] : house.edge_of_segment) {
    for (const auto& [id2, edges2] : house.edge_of_segment) {
      if (id1 >= id2) continue;
      std::vector<LineMatch>& matches = scene.matches[{id1, id2}];
      for (line2D_t i = 0; i < edges1.size(); ++i) {
        for (line2D_t j = 0; j < edges2.size(); ++j) {
          if (edges1[i] >= 0 && edges1[i] == edges2[j]) matches.push_back({i, j, 0.1f});
        }
        matches.push_back({i, static_cast<line2D_t>(random.Index(edges2.size())), 0.2f});
      }
    }
  }
  return scene;
}

// Poses turned and moved by normal noise about these, but the first and the last: these fix the
// frame and the scale of an adjustment. Points are moved by 0.02.
inline Reconstruction Perturbed(const Reconstruction& model, double rotation_deg, double position,
                                uint64_t seed) {
  Reconstruction result = model;
  Random random(seed);
  const auto vector = [&](double sigma) {
    const double x = random.Normal(sigma), y = random.Normal(sigma);
    return Eigen::Vector3d(x, y, random.Normal(sigma));
  };
  const image_t first = 1, last = static_cast<image_t>(model.images.size());
  for (const auto& [image_id, image] : model.images) {
    if (image_id == first || image_id == last) continue;
    const Eigen::Vector3d turn = vector(DegToRad(rotation_deg) / std::sqrt(3.0));
    Rigid3d pose = image.cam_from_world;
    const Eigen::Vector3d centre = model.CameraCentre(image_id) + vector(position);
    pose.rotation =
        Eigen::Quaterniond(Eigen::AngleAxisd(turn.norm(), turn.normalized())) * pose.rotation;
    pose.translation = -(pose.rotation * centre);
    result.SetFramePose(image.frame_id, pose);
  }
  for (auto& [id, point] : result.points3D) point.xyz += vector(0.02);
  return result;
}

// Root mean squares over all images.
struct PoseErrors {
  double rotation_deg = 0.0, position = 0.0;
};
inline PoseErrors ErrorsOf(const Reconstruction& model, const Reconstruction& truth) {
  PoseErrors sums;
  for (const auto& [id, image] : truth.images) {
    const Eigen::Quaterniond& q = model.images.at(id).cam_from_world.rotation;
    const double angle = RadToDeg(q.angularDistance(image.cam_from_world.rotation));
    sums.rotation_deg += angle * angle;
    sums.position += (model.CameraCentre(id) - truth.CameraCentre(id)).squaredNorm();
  }
  const double n = static_cast<double>(truth.images.size());
  return {std::sqrt(sums.rotation_deg / n), std::sqrt(sums.position / n)};
}

// How many edges have a line that passes both ends within `tolerance`.
inline size_t NumEdgesFound(const Reconstruction& model, const std::vector<Edge3d>& edges,
                            double tolerance) {
  size_t found = 0;
  for (const auto& [start, end] : edges) {
    for (const auto& [id, line] : model.lines3D) {
      if ((line.line.ClosestPoint(start) - start).norm() < tolerance &&
          (line.line.ClosestPoint(end) - end).norm() < tolerance) {
        ++found;
        break;
      }
    }
  }
  return found;
}

// How many of the corners have a point within `tolerance`.
inline size_t NumCornersFound(const Reconstruction& model, const std::vector<point3D_t>& points,
                              const std::vector<Eigen::Vector3d>& corners, double tolerance) {
  return std::count_if(corners.begin(), corners.end(), [&](const Eigen::Vector3d& corner) {
    return std::any_of(points.begin(), points.end(), [&](point3D_t id) {
      const Point3D* point = model.points3D.Find(id);
      return point && (point->xyz - corner).norm() < tolerance;
    });
  });
}

// Groups of a type whose parameters are these, up to a common sign, to `tolerance` in each.
inline size_t NumGroupsAt(const Reconstruction& model, const char* type,
                          const Eigen::VectorXd& params, double tolerance) {
  size_t found = 0;
  for (const auto& [id, group] : model.groups3D) {
    if (group.type != FindGroupType(type)) continue;
    const Eigen::Map<const Eigen::VectorXd> own(group.params.data(), group.params.size());
    found += std::min((own - params).cwiseAbs().maxCoeff(), (own + params).cwiseAbs().maxCoeff()) <
             tolerance;
  }
  return found;
}

}  // namespace holba
