// SPDX-License-Identifier: BSD-3-Clause
// Which features may take part in what moves cameras (paper, appendix "Reliability-Aware
// Refinement"): by the number of their observations and the uncertainty that the observations
// leave, cameras held.
#pragma once

#include <cstddef>
#include <map>
#include <string>
#include <unordered_set>

#include "holba/base/options.h"
#include "holba/scene/reconstruction.h"

namespace holba {

struct ReliabilityOptions {
  // Two images and 1.5 degrees are COLMAP's bounds.
  int min_point_images = 2;
  double min_point_angle_deg = 1.5;
  // Two images determine a line from four coordinates: nothing is left to tell a wrong one.
  int min_line_images = 3;
  // Standard deviation of a point, or of the ends of a line across it, in the worst direction,
  // relative to the depth.
  double max_point_relative_sigma = 0.05;
  double max_line_relative_sigma = 0.05;

  void Describe(OptionTable* table) const;
};

struct Reliability {
  std::unordered_set<point3D_t> unreliable_points;
  std::unordered_set<line3D_t> unreliable_lines;
  // "points: fewer than 2 images", ...
  std::map<std::string, size_t> reasons;
};

// Of features whose observations have noise of these standard deviations, px.
Reliability ClassifyFeatures(const ReliabilityOptions& options, double point_sigma_px,
                             double line_sigma_px, int num_threads, const Reconstruction& model);

}  // namespace holba
