// SPDX-License-Identifier: BSD-3-Clause
// Covariances of the elements of a model, as an adjustment leaves them: with the gauge that it
// held (a pose that was held has a covariance of 0), in model units.
#pragma once

#include <Eigen/Core>
#include <map>
#include <utility>

#include "holba/geometry/types.h"
#include "holba/scene/types.h"

namespace holba {

struct LineCovariance {
  // Of the end points of the extent; along the line they are held (rank 2).
  Eigen::Matrix3d start = Eigen::Matrix3d::Zero();
  Eigen::Matrix3d end = Eigen::Matrix3d::Zero();
};

struct ModelUncertainty {
  // Of the noise that one observed coordinate of a point was measured to have.
  double sigma_px = 0.0;
  // Of rig_from_world: w (rad) of R' = exp(w) R, then the translation.
  std::map<frame_t, Matrix6d> poses;
  // Of sensor_from_rig, alike: sensors whose pose in their rig was adjusted.
  std::map<std::pair<rig_t, camera_t>, Matrix6d> sensors;
  std::map<point3D_t, Eigen::Matrix3d> points;
  std::map<line3D_t, LineCovariance> lines;
  // Of the plain parameters of the files.
  std::map<group3D_t, Eigen::MatrixXd> groups;
};

}  // namespace holba
