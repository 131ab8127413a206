// SPDX-License-Identifier: BSD-3-Clause
// Which image is registered next.
#pragma once

#include <vector>

#include "holba/sfm/mapper_options.h"
#include "holba/sfm/mapper_state.h"

namespace holba {

// Images without a pose that see something of the model, the best first: those that have not been
// tried before those that have, then by the number and spread of the points and lines they see.
std::vector<image_t> RankNextImages(const NextImageOptions& options, MapperState* state);

// The same by the number of matches with images of the model, whether these have 3D points or not:
// for registration without structure.
std::vector<image_t> RankByMatches(const NextImageOptions& options, size_t min_num_matches,
                                   const MapperState& state);

}  // namespace holba
