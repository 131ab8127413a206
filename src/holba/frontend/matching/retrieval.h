// SPDX-License-Identifier: BSD-3-Clause
// Which images of a set look alike. Each has a global descriptor, VLAD (Jegou, Douze, Schmid, Perez
// 2010) of its point descriptors over a vocabulary that is learnt from the set itself, with
// normalised words and signed square roots (Arandjelovic and Zisserman 2013). The images that are
// nearest by it vote: matches of a few hundred of their points, found exactly. Then each global
// descriptor is averaged with those of its nearest neighbours (database augmentation, Turcot and
// Lowe 2009; Arandjelovic and Zisserman 2012), which joins images of a place that share little
// themselves but the same neighbours.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "holba/scene/keypoints.h"

namespace holba {

struct RetrievalOptions {
  int num_words = 64;
  // Of each image the first ones.
  size_t max_descriptors_per_image = 1000;
  // The vocabulary is learnt from so many descriptors, the first ones of all images.
  size_t num_training = 50000;
  int num_iterations = 10;
  // Images nearest to each by the global descriptors that votes are counted for, and the first
  // descriptors of both that are matched: a tenth of a millisecond a pair.
  size_t num_voting_images = 100;
  size_t num_voting_descriptors = 512;
  // What log(1 + votes) counts beside the cosine of the global descriptors: 20 votes as much as
  // 0.15. This, the two numbers above and the one below were chosen on half of the sets of
  // docs/benchmarks.md.
  double vote_weight = 0.05;
  size_t num_averaged = 3;
  uint64_t seed = 0;
  int num_threads = -1;
};

// For each image the most similar other ones, best first; at most `count`, none without
// descriptors. Descriptors come with the most telling ones first (StrongestFirst). All are of one
// kind and length; others count as none.
std::vector<std::vector<uint32_t>> FindImagesAlike(const RetrievalOptions& options,
                                                   std::span<const Descriptors> images,
                                                   size_t count);

// The `count` descriptors whose keypoints are largest, largest first: points that are seen from
// near and far. Of keypoints without a scale evenly spread ones, in their order.
Descriptors StrongestFirst(const Keypoints& keypoints, const Descriptors& descriptors,
                           size_t count);

}  // namespace holba
