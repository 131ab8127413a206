// SPDX-License-Identifier: BSD-3-Clause
// Lines. PlueckerLine is the form of files and formulas: unit direction d and moment m = p x d for
// any point p on the line. AnchoredLine is the form of the optimiser: direction and one point on
// it, well conditioned also for lines through the origin (where the orthonormal form is singular).
#pragma once

#include <Eigen/Core>
#include <cmath>

#include "holba/geometry/rigid3d.h"
#include "holba/geometry/types.h"

namespace holba {

struct PlueckerLine {
  Eigen::Vector3d direction = Eigen::Vector3d::UnitX();
  Eigen::Vector3d moment = Eigen::Vector3d::Zero();

  static PlueckerLine FromPointDirection(const Eigen::Vector3d& point, const Eigen::Vector3d& d);
  static PlueckerLine FromPoints(const Eigen::Vector3d& a, const Eigen::Vector3d& b);
  // Point of the line nearest to the origin.
  Eigen::Vector3d Foot() const;
  Eigen::Vector3d ClosestPoint(const Eigen::Vector3d& x) const;
  double Distance(const Eigen::Vector3d& x) const;
};

// In b for a line given in a: d_b = R d, m_b = R m + t x (R d).
PlueckerLine Transform(const Rigid3d& b_from_a, const PlueckerLine& line);
PlueckerLine Transform(const Sim3d& b_from_a, const PlueckerLine& line);

struct LineSegment2d {
  Eigen::Vector2d start = Eigen::Vector2d::Zero();
  Eigen::Vector2d end = Eigen::Vector2d::Zero();

  // Of pairs of segments in inner loops: on plain numbers.
  double Length() const {
    const double dx = end.x() - start.x(), dy = end.y() - start.y();
    return std::sqrt(dx * dx + dy * dy);
  }
  // Homogeneous line through both ends with unit normal: l.(x, y, 1) is the signed distance.
  Eigen::Vector3d Line() const {
    const double length = Length();
    const double scale = length > 0.0 ? length : 1.0;
    const double nx = -((end.y() - start.y()) / scale), ny = (end.x() - start.x()) / scale;
    return {nx, ny, -(nx * start.x() + ny * start.y())};
  }
};

}  // namespace holba
