// SPDX-License-Identifier: BSD-3-Clause
// The geometry of two images whose cameras are taken for what they are now, whatever verified their
// matches.
#pragma once

#include "holba/estimation/two_view/two_view_estimation.h"
#include "holba/sfm/mapper_state.h"

namespace holba {

struct CalibratedPairOptions {
  int min_num_inliers = TwoViewOptions().min_num_inliers;
  double max_error_px = TwoViewOptions().max_error;
  int random_seed = 0;
};

// From all verified matches of the images, registered or not.
TwoViewResult EstimateCalibratedPair(const CalibratedPairOptions& options, const MapperState& state,
                                     image_t image_id1, image_t image_id2);

}  // namespace holba
