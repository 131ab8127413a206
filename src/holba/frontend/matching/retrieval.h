// SPDX-License-Identifier: BSD-3-Clause
// Which images of a set look alike, by a global descriptor of each: VLAD (Jegou, Douze, Schmid,
// Perez 2010) of its point descriptors over a vocabulary that is learnt from the set itself, with
// signed square roots and normalised words (Arandjelovic and Zisserman 2013).
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "holba/scene/keypoints.h"

namespace holba {

struct RetrievalOptions {
  int num_words = 64;
  // Of each image, spread evenly over its descriptors; the strongest points are not the first in
  // COLMAP's databases.
  size_t max_descriptors_per_image = 1000;
  // The vocabulary is learnt from so many descriptors, spread evenly over the images.
  size_t num_training = 50000;
  int num_iterations = 10;
  uint64_t seed = 0;
  int num_threads = -1;
};

// One global descriptor of unit length for each image (rows of equal length, one after the other;
// zeros: the image has no descriptors). All local descriptors are of one kind and length; others
// count as none.
class ImageRetrieval {
 public:
  ImageRetrieval(const RetrievalOptions& options, std::span<const Descriptors> images);

  size_t num_images() const { return num_images_; }
  // The most similar other images, best first; at most `count`, none without descriptors.
  std::vector<uint32_t> Nearest(size_t image, size_t count) const;

 private:
  size_t num_images_ = 0, length_ = 0;
  std::vector<float> global_;
};

}  // namespace holba
