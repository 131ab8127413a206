// SPDX-License-Identifier: BSD-3-Clause
// Rigid3d: x_b = R x_a + t, named b_from_a. Sim3d: x_b = s R x_a + t. Their products are compiled
// once, in rigid3d.cc: nearly every file includes this one, and most of the time of a small file
// would go into the templates of Eigen behind them.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "holba/geometry/types.h"

namespace holba {

struct Rigid3d {
  // As read from a file it may be off unit length by rounding; Matrix() and * normalise it.
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();

  Rigid3d() = default;
  Rigid3d(const Eigen::Quaterniond& r, const Eigen::Vector3d& t) : rotation(r), translation(t) {}

  Eigen::Matrix3d RotationMatrix() const;
  Eigen::Vector3d operator*(const Eigen::Vector3d& x) const;
  // c_from_a = c_from_b * b_from_a
  Rigid3d operator*(const Rigid3d& b_from_a) const;
  Rigid3d Inverse() const;
  // Origin of b in a: the camera centre of a cam_from_world.
  Eigen::Vector3d OriginInA() const;
};

struct Sim3d {
  double scale = 1.0;
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();

  Eigen::Vector3d operator*(const Eigen::Vector3d& x) const;
  Sim3d Inverse() const;
  // Pose of a camera in the new frame: cam_from_new for this = new_from_old. The camera frame keeps
  // unit scale, so the translation is multiplied by the scale.
  Rigid3d TransformPose(const Rigid3d& cam_from_old) const;
};

// Rotation by |w| radians about w.
Eigen::Quaterniond ExpRotation(const Eigen::Vector3d& w);
// Inverse of ExpRotation, |w| <= pi.
Eigen::Vector3d LogRotation(const Eigen::Quaterniond& rotation);

}  // namespace holba
