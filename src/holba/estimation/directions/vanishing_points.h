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
  // The same for a vanishing point whose direction is orthogonal to that of an accepted one.
  int min_orthogonal_support = 5;
  double max_orthogonality_error_deg = 3.0;
  // Largest probability that a vanishing point gets its number of lines by chance: that of as many
  // segments agreeing with one given point, among those that no other vanishing point has, if their
  // directions were random. Images with many short segments therefore need more lines. The
  // probability is that of a single point although hundreds are tried per image; real leftover
  // segments agree less often than random ones. For a direction orthogonal to an accepted one, the
  // probability of being orthogonal by chance is a further factor.
  double max_chance = 0.01;
  // Segments within this distance of the line of a longer segment are pieces of the same line or
  // edges of the same bar: together they count as one line.
  double min_line_distance_px = 3.0;
  // Two vanishing points nearer than this are one that was found twice.
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
