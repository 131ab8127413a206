// SPDX-License-Identifier: BSD-3-Clause
// Small models with exact observations for the tests of points, junctions, corners and wireframes.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cmath>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "holba/base/check.h"
#include "holba/camera/camera_model.h"
#include "holba/estimation/points/point_triangulation.h"
#include "holba/scene/ideal_view.h"
#include "holba/scene/reconstruction.h"

namespace holba {

// Cameras on an arc of radius 8 about the origin, at two heights, all looking at it; 800 x 600.
inline Reconstruction ArcOfCameras(int num_images, std::string_view camera_model = "PINHOLE") {
  Reconstruction model;
  Camera camera{.model = FindCameraModel(camera_model), .width = 800, .height = 600, .params = {}};
  HOLBA_CHECK(camera.model != nullptr);
  if (camera_model == "PINHOLE") {
    camera.params = {700, 710, 400, 300};
  } else if (camera_model == "OPENCV") {
    camera.params = {700, 710, 405, 296, -0.15, 0.04, 0.002, -0.001};
  } else {
    HOLBA_CHECK_MSG(false, "no parameters for this camera model");
  }
  model.cameras.Add(1, camera);
  for (int i = 0; i < num_images; ++i) {
    const double angle = 0.12 * (i - 0.5 * (num_images - 1));
    const Eigen::Vector3d centre =
        8.0 * Eigen::Vector3d(std::sin(angle), i % 2 == 0 ? -0.25 : -0.05, -std::cos(angle));
    const Eigen::Vector3d z = -centre.normalized();
    const Eigen::Vector3d x = Eigen::Vector3d::UnitY().cross(z).normalized();
    Eigen::Matrix3d R;
    R << x.transpose(), z.cross(x).transpose(), z.transpose();
    const auto id = static_cast<image_t>(i + 1);
    model.images.Add(id, {.name = "image" + std::to_string(i),
                          .camera_id = 1,
                          .cam_from_world = {Eigen::Quaterniond(R), -R * centre}});
  }
  model.AddTrivialRigsAndFrames();
  return model;
}

// A line and the segments that see it, in the images with these positions (all: empty), their ends
// cut by `cut_px` and moved across the segment by `shift_px`.
inline line3D_t AddLineWithSegments(const Eigen::Vector3d& start, const Eigen::Vector3d& end,
                                    double cut_px, double shift_px, Reconstruction* model,
                                    const std::vector<size_t>& images = {}) {
  const line3D_t id = model->lines3D.size() + 1;
  Line3D line{.line = PlueckerLine::FromPoints(start, end), .start = start, .end = end};
  line.rgb = {100, static_cast<uint8_t>(id), 50};
  for (size_t i = 0; i < model->images.size(); ++i) {
    if (!images.empty() && std::find(images.begin(), images.end(), i) == images.end()) continue;
    auto& [image_id, image] = model->images.begin()[i];
    const IdealView view(*model, image_id);
    const auto a = view.Project(start), b = view.Project(end);
    if (!a || !b) continue;
    const Eigen::Vector2d along = (*b - *a).normalized(), across(-along.y(), along.x());
    const auto pixel1 = view.ToPixel(*a + cut_px * along + shift_px * across);
    const auto pixel2 = view.ToPixel(*b - cut_px * along + shift_px * across);
    if (!pixel1 || !pixel2) continue;
    line.track.push_back({image_id, static_cast<line2D_t>(image.lines2D.size())});
    image.lines2D.push_back({{*pixel1, *pixel2}, id});
  }
  HOLBA_CHECK(model->lines3D.Add(id, line));
  return id;
}

// A point with exact observations in the images with these positions (all: empty).
inline point3D_t AddPointWithObservations(const Eigen::Vector3d& xyz, Reconstruction* model,
                                          const std::vector<size_t>& images = {}) {
  std::vector<std::pair<image_t, Eigen::Vector2d>> observations;
  for (size_t i = 0; i < model->images.size(); ++i) {
    if (!images.empty() && std::find(images.begin(), images.end(), i) == images.end()) continue;
    const image_t image_id = model->images.begin()[i].first;
    const IdealView view(*model, image_id);
    const auto ideal = view.Project(xyz);
    HOLBA_CHECK(ideal.has_value());
    observations.emplace_back(image_id, view.ToPixel(*ideal).value());
  }
  return AddPointOfStructure(xyz, PointOrigin::kDetected, {0, 0, 0}, observations, model);
}

inline std::vector<Eigen::Vector3d> BoxCorners() {
  std::vector<Eigen::Vector3d> corners;
  for (int i = 0; i < 8; ++i) {
    corners.emplace_back(i & 1 ? 1.1 : -0.9, i & 2 ? 0.7 : -0.8, i & 4 ? 1.2 : -1.0);
  }
  return corners;
}

// The 12 edges of a box of glass, seen in all images, each segment cut by `cut_px` at both ends.
inline void AddBox(double cut_px, Reconstruction* model) {
  const std::vector<Eigen::Vector3d> corners = BoxCorners();
  for (int i = 0; i < 8; ++i) {
    for (int axis = 1; axis < 8; axis *= 2) {
      if (!(i & axis)) AddLineWithSegments(corners[i], corners[i | axis], cut_px, 0.0, model);
    }
  }
}

}  // namespace holba
