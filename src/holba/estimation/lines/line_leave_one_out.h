// SPDX-License-Identifier: BSD-3-Clause
// How well lines foretell images that took no part in them: each image of a line is left out in
// turn, the line is fitted to the others, and its image compared with the segment left out.
#pragma once

#include <vector>

#include "holba/scene/reconstruction.h"

namespace holba {

struct LeaveOneOutReport {
  // Mean distance, px, of the two ends of each segment left out from the image of its line; by line
  // in the model's order, then by element of its track.
  std::vector<double> distances_px;
  double median_px = 0.0;  // 0: there are none
  double share_below_1_px = 0.0;
  double share_above_3_px = 0.0;
  size_t num_lines = 0;  // that took part
  // Lines of fewer than `min_images` images, and fits that failed.
  size_t too_few_images = 0, no_fit = 0;
};

// For lines of at least min_images (at least 3) images. Pixels alone: no groups hold the fit, so
// that a line in the plane of its cameras foretells well without being known well.
LeaveOneOutReport LeaveOneOut(const Reconstruction& model, int min_images, int num_threads);

}  // namespace holba
