// SPDX-License-Identifier: BSD-3-Clause
// A direction in space from the images of lines along it: what an image segment says about a
// direction, and the direction that many segments of any images agree on.
#pragma once

#include <Eigen/Core>
#include <limits>
#include <optional>
#include <span>

#include "holba/geometry/line.h"

namespace holba {

// A segment of a calibrated view as evidence about a direction d (unit, any frame): with the image
// v = K R d of the direction, u = v_xy - v_z m points from the middle m of the segment to the
// vanishing point, and with the segment's half h the error is the distance of its ends from the
// line through m along u, |h x u| / |u|. Both are linear in d: h x u = normal . d.
class DirectionEvidence {
 public:
  // KR: calibration times rotation, camera from the frame of the direction.
  DirectionEvidence(const LineSegment2d& ideal, const Eigen::Matrix3d& KR)
      : half_squared_(0.25 * (ideal.end - ideal.start).squaredNorm()), v_z_(KR.row(2)) {
    const Eigen::Vector2d middle = 0.5 * (ideal.start + ideal.end);
    const Eigen::Vector2d half = 0.5 * (ideal.end - ideal.start);
    u_ = KR.topRows<2>() - middle * v_z_;
    normal_ = half.x() * u_.row(1) - half.y() * u_.row(0);
  }

  // Normal of the plane through the camera centre and the segment; its norm grows with the length.
  const Eigen::Vector3d& normal() const { return normal_; }
  // Squared px. Infinite where the vanishing point lies on the segment, which a line never reaches.
  double SquaredError(const Eigen::Vector3d& d) const {
    const double distance = SquaredDistance(d);
    const double v_z = v_z_.dot(d);
    if (!(distance > v_z * v_z * half_squared_)) return std::numeric_limits<double>::infinity();
    const double cross = normal_.dot(d);
    return cross * cross / distance;
  }
  // |u|^2: of the middle from the vanishing point, times v_z^2.
  double SquaredDistance(const Eigen::Vector3d& d) const { return (u_ * d).squaredNorm(); }

 private:
  double half_squared_;
  Eigen::RowVector3d v_z_;
  Eigen::Matrix<double, 2, 3> u_;  // of d
  Eigen::Vector3d normal_;
};

// Direction with the least sum of Tukey's biweight of the errors (scale max_error_px: from there
// on an error does not matter), near `start`, by reweighted least squares. Empty: fewer than two
// segments agree, or they do not fix it.
std::optional<Eigen::Vector3d> RefineDirection(std::span<const DirectionEvidence> evidence,
                                               double max_error_px, const Eigen::Vector3d& start);

}  // namespace holba
