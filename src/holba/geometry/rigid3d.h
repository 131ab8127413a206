// SPDX-License-Identifier: BSD-3-Clause
// Rigid3d: x_b = R x_a + t, named b_from_a. Sim3d: x_b = s R x_a + t.
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

  Eigen::Matrix3d RotationMatrix() const { return rotation.normalized().toRotationMatrix(); }
  Eigen::Vector3d operator*(const Eigen::Vector3d& x) const {
    return rotation.normalized() * x + translation;
  }
  // c_from_a = c_from_b * b_from_a
  Rigid3d operator*(const Rigid3d& b_from_a) const {
    const Eigen::Quaterniond q = rotation.normalized();
    return {q * b_from_a.rotation.normalized(), q * b_from_a.translation + translation};
  }
  Rigid3d Inverse() const {
    const Eigen::Quaterniond q = rotation.normalized().conjugate();
    return {q, -(q * translation)};
  }
  // Origin of b in a: the camera centre of a cam_from_world.
  Eigen::Vector3d OriginInA() const { return -(rotation.normalized().conjugate() * translation); }
};

struct Sim3d {
  double scale = 1.0;
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();

  Eigen::Vector3d operator*(const Eigen::Vector3d& x) const {
    return scale * (rotation * x) + translation;
  }
  Sim3d Inverse() const {
    Sim3d inverse;
    inverse.scale = 1.0 / scale;
    inverse.rotation = rotation.conjugate();
    inverse.translation = -inverse.scale * (inverse.rotation * translation);
    return inverse;
  }
  // Pose of a camera in the new frame: cam_from_new for this = new_from_old. The camera frame keeps
  // unit scale, so the translation is multiplied by the scale.
  Rigid3d TransformPose(const Rigid3d& cam_from_old) const {
    const Eigen::Quaterniond r = cam_from_old.rotation.normalized() * rotation.conjugate();
    return {r, scale * cam_from_old.translation - r * translation};
  }
};

// Rotation by |w| radians about w.
inline Eigen::Quaterniond ExpRotation(const Eigen::Vector3d& w) {
  const double angle = w.norm();
  const double half = 0.5 * angle;
  // sin(a/2)/a from its series where the quotient would be 0/0.
  const double k = angle > 1e-8 ? std::sin(half) / angle : 0.5 - angle * angle / 48.0;
  return Eigen::Quaterniond(std::cos(half), k * w.x(), k * w.y(), k * w.z());
}

// Inverse of ExpRotation, |w| <= pi.
inline Eigen::Vector3d LogRotation(const Eigen::Quaterniond& rotation) {
  Eigen::Quaterniond q = rotation.normalized();
  if (q.w() < 0) q.coeffs() = -q.coeffs();
  const double s = q.vec().norm();
  if (s < 1e-12) return 2.0 * q.vec();
  return 2.0 * std::atan2(s, q.w()) / s * q.vec();
}

}  // namespace holba
