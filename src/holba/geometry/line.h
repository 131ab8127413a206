// SPDX-License-Identifier: BSD-3-Clause
// Lines. PlueckerLine is the form of files and formulas: unit direction d and moment m = p x d for any
// point p on the line. AnchoredLine is the form of the optimiser: direction and one point on it, well
// conditioned also for lines through the origin (where the orthonormal form is singular).
#pragma once

#include <Eigen/Core>

#include "holba/geometry/rigid3d.h"
#include "holba/geometry/types.h"

namespace holba {

struct PlueckerLine {
  Eigen::Vector3d direction = Eigen::Vector3d::UnitX();
  Eigen::Vector3d moment = Eigen::Vector3d::Zero();

  static PlueckerLine FromPointDirection(const Eigen::Vector3d& point, const Eigen::Vector3d& d) {
    const Eigen::Vector3d unit = d.normalized();
    return {unit, point.cross(unit)};
  }
  static PlueckerLine FromPoints(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
    return FromPointDirection(a, b - a);
  }
  // Point of the line nearest to the origin.
  Eigen::Vector3d Foot() const { return direction.cross(moment) / direction.squaredNorm(); }
  Eigen::Vector3d ClosestPoint(const Eigen::Vector3d& x) const {
    const Eigen::Vector3d foot = Foot();
    return foot + direction * direction.dot(x - foot) / direction.squaredNorm();
  }
  double Distance(const Eigen::Vector3d& x) const { return (x - ClosestPoint(x)).norm(); }
};

// In b for a line given in a: d_b = R d, m_b = R m + t x (R d).
inline PlueckerLine Transform(const Rigid3d& b_from_a, const PlueckerLine& line) {
  const Eigen::Quaterniond q = b_from_a.rotation.normalized();
  const Eigen::Vector3d d = q * line.direction;
  return {d, q * line.moment + b_from_a.translation.cross(d)};
}

inline PlueckerLine Transform(const Sim3d& b_from_a, const PlueckerLine& line) {
  const Eigen::Vector3d d = b_from_a.rotation * line.direction;
  return {d, b_from_a.scale * (b_from_a.rotation * line.moment) + b_from_a.translation.cross(d)};
}

struct LineSegment2d {
  Eigen::Vector2d start = Eigen::Vector2d::Zero();
  Eigen::Vector2d end = Eigen::Vector2d::Zero();

  double Length() const { return (end - start).norm(); }
  // Homogeneous line through both ends with unit normal: l.(x, y, 1) is the signed distance.
  Eigen::Vector3d Line() const {
    const Eigen::Vector2d along = (end - start).normalized();
    const Eigen::Vector2d normal(-along.y(), along.x());
    return {normal.x(), normal.y(), -normal.dot(start)};
  }
};

}  // namespace holba
