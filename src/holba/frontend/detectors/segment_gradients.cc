// SPDX-License-Identifier: BSD-3-Clause
#include "holba/frontend/detectors/segment_gradients.h"

#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "holba/base/check.h"

namespace holba {

GradientImage::GradientImage(const GreyImage& image, double sigma_px)
    : width_(image.width),
      height_(image.height),
      gradients_(static_cast<size_t>(image.width) * image.height) {
  HOLBA_CHECK_MSG(width_ >= 2 && height_ >= 2, "an image of at least 2 x 2 pixels");
  const cv::Mat grey(height_, width_, CV_8UC1, const_cast<uint8_t*>(image.pixels.data()));
  cv::Mat smooth;
  grey.convertTo(smooth, CV_32F);
  if (sigma_px > 0.0)
    cv::GaussianBlur(smooth, smooth, cv::Size(), sigma_px, sigma_px, cv::BORDER_REPLICATE);
  for (int y = 0; y < height_; ++y) {
    const float* row = smooth.ptr<float>(y);
    const float* above = smooth.ptr<float>(std::max(y - 1, 0));
    const float* below = smooth.ptr<float>(std::min(y + 1, height_ - 1));
    Eigen::Vector2f* out = &gradients_[static_cast<size_t>(y) * width_];
    for (int x = 1; x + 1 < width_; ++x)
      out[x] = {0.5f * (row[x + 1] - row[x - 1]), 0.5f * (below[x] - above[x])};
    const int last = width_ - 1;
    out[0] = {0.5f * (row[1] - row[0]), 0.5f * (below[0] - above[0])};
    out[last] = {0.5f * (row[last] - row[last - 1]), 0.5f * (below[last] - above[last])};
  }
}

}  // namespace holba
