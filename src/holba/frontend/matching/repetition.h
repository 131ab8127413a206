// SPDX-License-Identifier: BSD-3-Clause
// How much of what two images share is there several times.
#pragma once

#include <optional>
#include <vector>

#include "holba/frontend/matching/guided_matching.h"
#include "holba/scene/pair_repetition.h"

namespace holba {

// Of a verified pair. `neighbours`: of these descriptors (FindNeighbours). `positions`: as
// MatchGuided has them, those of the geometry. Inliers name described points.
PairRepetition MeasureRepetition(const DescriptorMatchOptions& options,
                                 const GuidingGeometry& geometry, const Neighbours& neighbours,
                                 const PackedDescriptors& descriptors1,
                                 const std::vector<std::optional<Eigen::Vector2d>>& positions1,
                                 const PackedDescriptors& descriptors2,
                                 const std::vector<std::optional<Eigen::Vector2d>>& positions2,
                                 const PointMatches& inliers);

}  // namespace holba
