// SPDX-License-Identifier: BSD-3-Clause
// A line in space from segments that match each other, of which some may be wrong: what an
// incremental mapper does with each new image (all at once: lines_from_segments.h).
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "holba/estimation/lines/line_fit.h"
#include "holba/estimation/lines/line_options.h"

namespace holba {

struct TriangulatedLine {
  AnchoredLine line;
  double t_start = 0.0, t_end = 0.0;  // extent, as parameters of AnchoredLine::At
  std::vector<bool> is_inlier;        // for each support
  size_t num_images = 0;              // of the inliers
  double relative_sigma = 0.0;        // of the worse end, across the line, by its depth
};

// Every pair of supports of different views is tried (the meet of their planes), the line that
// agrees with most images is fitted to these. A support agrees if both ends are within
// max_distance_px, and it shows a part that others show, too. Empty: no pair of planes meets at
// min_ray_plane_angle_deg, fewer than min_num_images agree, or the line is not known to
// max_relative_sigma.
std::optional<TriangulatedLine> TriangulateLine(std::span<const LineSupport> supports,
                                                const LineOptions& options, size_t min_num_images,
                                                double max_relative_sigma);

// Whether a segment shows a line whose extent is known: near its image, and overlapping.
bool ShowsLine(const LineSupport& support, const AnchoredLine& line, double t_start, double t_end,
               double max_distance_px, double min_overlap);

}  // namespace holba
