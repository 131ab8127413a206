// SPDX-License-Identifier: BSD-3-Clause
// Pairs of images that are worth matching, chosen by the points that a model's images share.
#pragma once

#include <map>
#include <span>
#include <vector>

#include "holba/base/options.h"
#include "holba/frontend/matching/line_matching.h"
#include "holba/scene/covisibility.h"
#include "holba/scene/image_features.h"
#include "holba/scene/reconstruction.h"

namespace holba {

// For each image those that share most points with it, with at least this many shared points.
struct ImagePairOptions {
  int max_pairs_per_image = 20;
  int min_shared_points = 10;

  void Describe(OptionTable* table) const;
};

// Where the images of each chosen pair see the same points.
std::map<ImagePair, std::vector<SharedPoint>> PairsWithSharedPoints(const ImagePairOptions& options,
                                                                    const Reconstruction& model);

// The pixels of what one image shares with another.
std::vector<SharedPoint> PixelsOf(const Image& image1, const Image& image2,
                                  std::span<const SharedSighting> shared);

}  // namespace holba
