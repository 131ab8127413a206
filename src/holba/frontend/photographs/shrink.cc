// SPDX-License-Identifier: BSD-3-Clause
#include "holba/frontend/photographs/shrink.h"

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "holba/base/check.h"

namespace holba {

ColourImage Shrunk(const ColourImage& image, int longer_side_px) {
  HOLBA_CHECK(longer_side_px >= 1);
  const int longer = std::max(image.width, image.height);
  if (longer <= longer_side_px) return image;
  const double scale = longer_side_px / static_cast<double>(longer);
  const auto side = [&](int length) {
    return std::max(1, static_cast<int>(std::lround(scale * length)));
  };
  ColourImage small{side(image.width), side(image.height), {}};
  small.pixels.resize(size_t{3} * small.width * small.height);
  const cv::Mat from(image.height, image.width, CV_8UC3, const_cast<uint8_t*>(image.pixels.data()));
  cv::Mat to(small.height, small.width, CV_8UC3, small.pixels.data());
  cv::resize(from, to, to.size(), 0, 0, cv::INTER_AREA);
  return small;
}

}  // namespace holba
