// SPDX-License-Identifier: BSD-3-Clause
// Matches of point descriptors once more, now among those points only that the geometry of the two
// views allows: what looks alike elsewhere in the picture no longer makes a match ambiguous.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "holba/frontend/matching/descriptor_matching.h"

namespace holba {

// Exactly one of F (x2' F x1 = 0) and H (x2 ~ H x1). Errors are Sampson distances, of homographies
// the root mean square of both transfer errors, pixels.
struct GuidingGeometry {
  std::optional<Eigen::Matrix3d> F, H;
  double max_error_px = 4.0;
};

// `positions`: of the described points, ideal pixels; empty: the point has none and no match.
DescriptorMatches MatchGuided(const DescriptorMatchOptions& options,
                              const GuidingGeometry& geometry,
                              const PackedDescriptors& descriptors1,
                              const std::vector<std::optional<Eigen::Vector2d>>& positions1,
                              const PackedDescriptors& descriptors2,
                              const std::vector<std::optional<Eigen::Vector2d>>& positions2);

}  // namespace holba
