// SPDX-License-Identifier: BSD-3-Clause
// Vanishing points of one calibrated image from its line segments: clusters by J-Linkage, refitted
// robustly, accepted by the number of distinct lines that run to them.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <vector>

#include "holba/base/options.h"
#include "holba/geometry/line.h"
#include "holba/scene/image_features.h"

namespace holba {

struct VanishingPointOptions {
  // A segment agrees with a vanishing point if its ends are within this of the line from its middle
  // to the point: some three standard deviations of an end, so that the angle it allows is that of
  // the segment's own uncertainty.
  double max_error_px = 1.0;
  // Shorter segments, whose directions are free within 6 degrees and more, agree with anything.
  double min_length_px = 20.0;
  // The linkage is quadratic in time and memory: of more segments the longest take part.
  int max_num_segments = 1000;
  // Pairs of segments that are intersected. With 5000 a point on which 5 % of the segments agree
  // is hit a dozen times.
  int num_hypotheses = 5000;
  uint64_t seed = 0;
  // Distinct lines that a vanishing point needs.
  int min_support = 8;
  // The same where its direction is orthogonal to that of one that is accepted already.
  int min_orthogonal_support = 5;
  double max_orthogonality_error_deg = 3.0;
  // Largest probability that as many of the segments that no other vanishing point has agree by
  // chance with a given one, were they in random directions. In pictures full of short segments it
  // takes more lines than in bare ones. It is one of the point, not of the picture, where hundreds
  // of points are tried; but what is left over in pictures is less than random. Where the direction
  // is orthogonal to another one, the probability of that counts as a factor.
  double max_chance = 0.01;
  // Segments within this of the line of a longer one are pieces of the same line or edges of the
  // same bar: they do not testify apart.
  double min_line_distance_px = 3.0;
  // Nearer ones are one vanishing point, found twice.
  double min_angle_deg = 3.0;

  void Describe(OptionTable* table) const;
};

struct VanishingPoints {
  std::vector<ImageVanishingPoint> points;  // by falling number of segments
  // For each segment the point it agrees with best, -1: none, or the segment is too short.
  std::vector<int32_t> vp_of_segment;
};

// Of the segments in ideal pixels of a view with calibration K (upper triangular).
VanishingPoints DetectVanishingPoints(const VanishingPointOptions& options,
                                      std::span<const LineSegment2d> ideal_segments,
                                      const Eigen::Matrix3d& K);

}  // namespace holba
