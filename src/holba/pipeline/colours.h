// SPDX-License-Identifier: BSD-3-Clause
// Colours of features from the photographs that show them, as COLMAP gives them to points.
#pragma once

#include <set>
#include <span>

#include "holba/pipeline/photograph_folder.h"
#include "holba/scene/reconstruction.h"

namespace holba {

// Mean colour over the images of the track: of these points at their pixels, of all lines along
// their segments. `without_photograph`: images that are passed over.
void ColourFeatures(const PhotographFolder& image_path, std::span<const point3D_t> point3D_ids,
                    int num_threads, Reconstruction* model,
                    const std::set<image_t>& without_photograph = {});

}  // namespace holba
