// SPDX-License-Identifier: BSD-3-Clause
#include "holba/geometry/rigid3d.h"

#include <cmath>

namespace holba {

Eigen::Matrix3d Rigid3d::RotationMatrix() const { return rotation.normalized().toRotationMatrix(); }

Eigen::Vector3d Rigid3d::operator*(const Eigen::Vector3d& x) const {
  return rotation.normalized() * x + translation;
}

Rigid3d Rigid3d::operator*(const Rigid3d& b_from_a) const {
  const Eigen::Quaterniond q = rotation.normalized();
  return {q * b_from_a.rotation.normalized(), q * b_from_a.translation + translation};
}

Rigid3d Rigid3d::Inverse() const {
  const Eigen::Quaterniond q = rotation.normalized().conjugate();
  return {q, -(q * translation)};
}

Eigen::Vector3d Rigid3d::OriginInA() const {
  return -(rotation.normalized().conjugate() * translation);
}

Eigen::Vector3d Sim3d::operator*(const Eigen::Vector3d& x) const {
  return scale * (rotation * x) + translation;
}

Sim3d Sim3d::Inverse() const {
  Sim3d inverse;
  inverse.scale = 1.0 / scale;
  inverse.rotation = rotation.conjugate();
  inverse.translation = -inverse.scale * (inverse.rotation * translation);
  return inverse;
}

Rigid3d Sim3d::TransformPose(const Rigid3d& cam_from_old) const {
  const Eigen::Quaterniond r = cam_from_old.rotation.normalized() * rotation.conjugate();
  return {r, scale * cam_from_old.translation - r * translation};
}

Eigen::Quaterniond ExpRotation(const Eigen::Vector3d& w) {
  const double angle = w.norm();
  const double half = 0.5 * angle;
  // sin(a/2)/a from its series where the quotient would be 0/0.
  const double k = angle > 1e-8 ? std::sin(half) / angle : 0.5 - angle * angle / 48.0;
  return Eigen::Quaterniond(std::cos(half), k * w.x(), k * w.y(), k * w.z());
}

Eigen::Vector3d LogRotation(const Eigen::Quaterniond& rotation) {
  Eigen::Quaterniond q = rotation.normalized();
  if (q.w() < 0) q.coeffs() = -q.coeffs();
  const double s = q.vec().norm();
  if (s < 1e-12) return 2.0 * q.vec();
  return 2.0 * std::atan2(s, q.w()) / s * q.vec();
}

}  // namespace holba
