// SPDX-License-Identifier: BSD-3-Clause
// Lowe's descriptor of a place: histograms of gradient directions, 8 for each of 4 x 4 cells, in
// the frame of the place's scale and orientation (Distinctive image features from scale-invariant
// keypoints, 2004). Not rounded: RootSIFT takes roots of small values.
#pragma once

#include <array>
#include <opencv2/core.hpp>
#include <vector>

namespace holba {

inline constexpr int kSiftDescriptorSize = 128;
using SiftDescriptor = std::array<float, kSiftDescriptorSize>;

class SiftDescriber {
 public:
  // `image`: single precision, blurred as the level of the place; place and scale in its pixels
  // (centre of the first one at 0), the angle from x towards y. Unit norm; all zero where there is
  // no gradient. Row of cells by row, the 8 directions against the sense of the angle, as in
  // COLMAP's databases.
  SiftDescriptor Describe(const cv::Mat& image, double x, double y, double sigma, double angle_rad);

 private:
  // Of the samples around the place.
  std::vector<float> dx_, dy_, column_, row_, weight_, magnitude_, angle_, weight_x_;
};

}  // namespace holba
