// SPDX-License-Identifier: BSD-3-Clause
// Corners: points on the junctions of edges, which blob detectors leave out. Shi and Tomasi (Good
// features to track, 1994), moved to where the gradients around them meet, with SIFT descriptors of
// one size.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "holba/base/options.h"
#include "holba/frontend/photographs/photograph.h"

namespace holba {

struct CornerOptions {
  int max_num_corners = 2500;  // the strongest; 0: none are looked for
  double quality = 0.002;      // smallest eigenvalue, as a share of the strongest corner's
  double min_distance_px = 4.0;

  void Describe(OptionTable* table) const;
};

struct Corners {
  std::vector<Eigen::Vector2d> positions;  // pixels, centre of the first one at 0.5
  std::vector<uint8_t> descriptors;        // kCornerDescriptorSize for each; upright
};

// `mask`: of the image's size, corners are where it is not 0; null: anywhere.
Corners DetectCorners(const CornerOptions& options, const GreyImage& image,
                      const GreyImage* mask = nullptr);

}  // namespace holba
