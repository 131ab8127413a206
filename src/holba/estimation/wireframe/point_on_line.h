// SPDX-License-Identifier: BSD-3-Clause
// Whether a point lies on a line in space, as far as both are known: within a distance in pixels,
// or farther where their covariances allow it. Lines along the motion of the cameras are weak in
// depth; being seen with a point in many images they may still pass it by many pixels.
#pragma once

#include <Eigen/Core>
#include <optional>

#include "holba/scene/reconstruction.h"
#include "holba/scene/views.h"

namespace holba {

struct PointOnLineOptions {
  double max_gap_gsd = 2.0;             // in pixels of the nearest view
  double max_uncertain_gap_gsd = 10.0;  // however uncertain
  double sigma_px = 0.5;                // of a coordinate of points and ends of segments
};

enum class PointOnLine { kNear, kAllowed, kApart };

// `covariance_1px`: of the point, for one pixel.
PointOnLine TestPointOnLine(const Reconstruction& model, const ViewMap& views,
                            const PointOnLineOptions& options, const Eigen::Vector3d& X,
                            const std::optional<Eigen::Matrix3d>& covariance_1px,
                            double pixels_per_length, const Line3D& line);

}  // namespace holba
