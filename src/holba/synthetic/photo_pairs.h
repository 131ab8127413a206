// SPDX-License-Identifier: BSD-3-Clause
// Which images of a synthetic set are matched, and their matches, right and wrong.
#pragma once

#include <cstdint>
#include <vector>

#include "holba/synthetic/photo_scene.h"
#include "holba/synthetic/photo_set.h"

namespace holba {

// A feature in a view, and its index there.
struct FoundFeature {
  uint32_t view = 0, idx = 0;
};
// What was found in the images of a scene. Tracks by feature, ascending by view, each view once;
// empty or single ones belong to nothing.
struct FoundFeatures {
  std::vector<std::vector<FoundFeature>> points, lines;
};

// images: keypoints and segments of every view. The pairs in the order of ids.
std::vector<PhotoSetPair> MakePairs(const PhotoSetOptions& options, const PhotoScene& scene,
                                    const FoundFeatures& found,
                                    const std::vector<PhotoSetImage>& images);

}  // namespace holba
