// SPDX-License-Identifier: BSD-3-Clause
// Which segments of two images may be images of one line: by descriptor, by the matched points
// around them (what tells repeated edges of a facade apart) and, where the views' geometry is
// known, by epipolar geometry.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include "holba/base/options.h"
#include "holba/geometry/line.h"
#include "holba/scene/image_features.h"
#include "holba/scene/reconstruction.h"

namespace holba {

struct LineMatchingOptions {
  // Matches kept for each segment of either image: which is right, geometry decides.
  int num_matches = 5;
  // Distance of descriptors, of unit norm, beyond which segments do not look alike.
  double max_descriptor_distance = 0.8;
  // Directions in the image may differ by this from the rotation that the shared points have.
  double max_rotation_deg = 35.0;
  // Shared points that tell where a segment is, however far they are: the reach of those around it
  // grows until there are so many. Three fix an affine frame. 0: only what is within 40 pixels.
  int num_near_points = 0;
  // Overlap (intersection over union) of the two segments along the epipolar lines.
  double min_epipolar_overlap = 0.1;

  void Describe(OptionTable* table) const;
};

// The segments of one image as matching wants them; made once for each image.
struct MatchableSegments {
  std::vector<LineSegment2d> segments;  // pixels of the photograph
  // Ideal pixels; empty: an end has none, then the segment matches nothing if geometry is asked.
  std::vector<std::optional<LineSegment2d>> ideal;
  std::vector<int16_t> descriptors;  // kSegmentDescriptorSize each, in steps of 1 / 16384
};
// The features must have descriptors of all segments.
MatchableSegments MakeMatchable(const ImageFeatures& features, const Camera& camera);

// Positions of one point in both photographs, pixels.
using SharedPoint = std::pair<Eigen::Vector2d, Eigen::Vector2d>;

// Sorted by the segments of the first image, the nearest first for each. Distances are sums of the
// descriptors' distance and half of one minus the cosine between the weights that the shared points
// have for the segments. F: x2' F x1 = 0 in ideal pixels (FundamentalMatrix of ideal_view.h);
// empty: unknown.
std::vector<LineMatch> MatchSegments(const LineMatchingOptions& options,
                                     const MatchableSegments& segments1,
                                     const MatchableSegments& segments2,
                                     const std::vector<SharedPoint>& shared_points,
                                     const std::optional<Eigen::Matrix3d>& F);

// Those of the matches of one pair of images that are the nearest of both of their segments, by a
// ratio below max_ratio to the second nearest of either: few are wrong.
std::vector<LineMatch> MutualNearest(const std::vector<LineMatch>& matches, double max_ratio);

}  // namespace holba
