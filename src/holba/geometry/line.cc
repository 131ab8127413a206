// SPDX-License-Identifier: BSD-3-Clause
#include "holba/geometry/line.h"

namespace holba {

PlueckerLine PlueckerLine::FromPointDirection(const Eigen::Vector3d& point,
                                              const Eigen::Vector3d& d) {
  const Eigen::Vector3d unit = d.normalized();
  return {unit, point.cross(unit)};
}

PlueckerLine PlueckerLine::FromPoints(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return FromPointDirection(a, b - a);
}

Eigen::Vector3d PlueckerLine::Foot() const {
  return direction.cross(moment) / direction.squaredNorm();
}

Eigen::Vector3d PlueckerLine::ClosestPoint(const Eigen::Vector3d& x) const {
  const Eigen::Vector3d foot = Foot();
  return foot + direction * direction.dot(x - foot) / direction.squaredNorm();
}

double PlueckerLine::Distance(const Eigen::Vector3d& x) const {
  return (x - ClosestPoint(x)).norm();
}

PlueckerLine Transform(const Rigid3d& b_from_a, const PlueckerLine& line) {
  const Eigen::Quaterniond q = b_from_a.rotation.normalized();
  const Eigen::Vector3d d = q * line.direction;
  return {d, q * line.moment + b_from_a.translation.cross(d)};
}

PlueckerLine Transform(const Sim3d& b_from_a, const PlueckerLine& line) {
  const Eigen::Vector3d d = b_from_a.rotation * line.direction;
  return {d, b_from_a.scale * (b_from_a.rotation * line.moment) + b_from_a.translation.cross(d)};
}

}  // namespace holba
