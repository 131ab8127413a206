// SPDX-License-Identifier: BSD-3-Clause
// Scenes for tests: points triangulated from noisy observations of cameras side by side.
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <cmath>
#include <string>
#include <vector>

#include "holba/base/check.h"
#include "holba/base/random.h"
#include "holba/estimation/points/point_uncertainty.h"
#include "holba/scene/reconstruction.h"

namespace holba {

// Cameras in a row along x, `baseline` apart about the origin, f = 700 px, looking along z; what
// lies 10 before them has a GSD of 1 / 70.
inline Reconstruction MakeCameraRow(int num_images, double baseline) {
  Reconstruction model;
  model.cameras.Add(1, {.model = FindCameraModel("PINHOLE"),
                        .width = 1000,
                        .height = 1000,
                        .params = {700, 700, 500, 500}});
  for (int i = 0; i < num_images; ++i) {
    const double x = baseline * (i - 0.5 * (num_images - 1));
    Image image{.name = std::to_string(i) + ".jpg", .camera_id = 1};
    image.cam_from_world.translation = Eigen::Vector3d(-x, 0.1 * (i % 2), 0.0);
    model.images.Add(static_cast<image_t>(i + 1), image);
  }
  model.AddTrivialRigsAndFrames();
  return model;
}

// Adds X as seen by every image with Gaussian noise, at the place of least squares of these
// observations. Returns its id.
inline point3D_t AddPoint(const Eigen::Vector3d& X, double noise_px, Random* random,
                          Reconstruction* model) {
  const ViewMap views(*model);
  const point3D_t id = model->points3D.size() + 1;
  Point3D point{.xyz = X};
  std::vector<Eigen::Vector2d> seen;
  for (auto& [image_id, image] : model->images) {
    const auto pixel = views.at(image_id).Project(X);
    HOLBA_CHECK(pixel.has_value());
    seen.push_back(*pixel + Eigen::Vector2d(random->Normal(noise_px), random->Normal(noise_px)));
    point.track.push_back({image_id, static_cast<point2D_t>(image.points2D.size())});
    image.points2D.push_back({.xy = seen.back(), .point3D_id = id});
  }
  for (int iteration = 0; iteration < 10; ++iteration) {
    Eigen::Matrix3d H = Eigen::Matrix3d::Zero();
    Eigen::Vector3d b = Eigen::Vector3d::Zero();
    for (size_t i = 0; i < seen.size(); ++i) {
      const IdealView& view = views.at(point.track[i].image_id);
      const Eigen::Vector3d x = view.R() * point.xyz + view.t();
      Eigen::Matrix<double, 2, 3> J;
      J << 700 / x.z(), 0, -700 * x.x() / (x.z() * x.z()), 0, 700 / x.z(),
          -700 * x.y() / (x.z() * x.z());
      J = J * view.R();
      const Eigen::Vector2d r = *view.Project(point.xyz) - seen[i];
      H += J.transpose() * J;
      b += J.transpose() * r;
    }
    point.xyz -= H.ldlt().solve(b);
  }
  model->points3D.Add(id, point);
  return id;
}

}  // namespace holba
