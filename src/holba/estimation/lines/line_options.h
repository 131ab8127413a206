// SPDX-License-Identifier: BSD-3-Clause
// Thresholds of building 3D lines from segments with known poses (lines_from_segments.h).
#pragma once

#include "holba/base/options.h"

namespace holba {

struct LineOptions {
  // Shorter segments repeat too rarely (under 50 % in the next image below 15 px) and their
  // direction says little.
  double min_segment_px = 10.0;

  // Images to look for the same line in: those that share most points.
  int max_neighbours = 20;
  // Of the rays of shared points, upper quartile: below, depths are noise.
  double min_neighbour_angle_deg = 1.0;

  // Candidates: pairs of segments that may be the same line.
  double min_epipolar_iou = 0.1;         // of a segment and the band of the other's epipolar lines
  double min_ray_plane_angle_deg = 1.0;  // below, the intersection has no depth
  // Depths between these factors of the 2nd and the 98th percentile of the image's points.
  double min_depth_factor = 0.5;
  double max_depth_factor = 2.0;
  double max_descriptor_distance = 0.8;  // unit vectors; only where segments are described
  int max_candidates = 5;                // for each segment in each neighbour
  // Segments have their brighter side where Line() is positive: opposite ones are no candidates.
  bool oriented = true;

  // Proposals from points, vanishing points and planes, beside the intersection of ray and plane.
  bool propose_from_points = true;
  bool propose_from_groups = true;

  // Sum over other images than the proposal's two of how well they agree, each at most 1: about
  // one.
  double min_score = 0.8;
  // The same of the best proposal of a line that ends in fewer than 4 images: clutter makes such
  // lines by chance.
  double min_score_of_few = 1.0;

  // A segment stays with a line while it is so near to its image.
  double max_distance_px = 1.5;
  double max_angle_deg = 8.0;
  double min_overlap = 0.3;

  // Rounds of merging lines, claiming free segments, refitting.
  int refinement_rounds = 2;
  double claim_distance_px = 1.5;
  double claim_angle_deg = 4.0;
  double claim_overlap = 0.5;
  double claim_descriptor_distance = 0.9;

  // Weight of a vanishing point's direction in the fit of a line that agrees with it.
  double vp_weight_px_per_rad = 500.0;
  // Weight of the distance, in pixels, to the plane that proposed a line whose depth is uncertain
  // without it.
  double plane_weight = 0.5;

  int min_images = 3;

  // Standard deviation of the ends of segments, for the uncertainty of lines; and below which
  // deviation of its ends, relative to their depth, a line counts as reliable.
  double sigma_px = 0.5;
  double max_relative_sigma = 0.01;

  void Describe(OptionTable* table) const;
};

}  // namespace holba
