// SPDX-License-Identifier: BSD-3-Clause
// Smoothed brightness gradients of an image: what refines, orients and describes its segments.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <vector>

#include "holba/frontend/photographs/photograph.h"

namespace holba {

class GradientImage {
 public:
  // Gaussian smoothing by sigma_px, then central differences; the image goes on beyond its border
  // with its last pixels.
  GradientImage(const GreyImage& image, double sigma_px);

  int width() const { return width_; }
  int height() const { return height_; }

  // Brightness per pixel at a position (centre of the first pixel: 0.5), bilinear; positions
  // outside take the nearest one inside.
  Eigen::Vector2f At(float x, float y) const {
    x = std::clamp(x - 0.5f, 0.0f, static_cast<float>(width_ - 1));
    y = std::clamp(y - 0.5f, 0.0f, static_cast<float>(height_ - 1));
    const int column = std::min(static_cast<int>(x), width_ - 2);
    const int row = std::min(static_cast<int>(y), height_ - 2);
    const float fx = x - static_cast<float>(column), fy = y - static_cast<float>(row);
    const Eigen::Vector2f* top = &gradients_[static_cast<size_t>(row) * width_ + column];
    const Eigen::Vector2f* bottom = top + width_;
    return (1.0f - fy) * ((1.0f - fx) * top[0] + fx * top[1]) +
           fy * ((1.0f - fx) * bottom[0] + fx * bottom[1]);
  }
  // The same of the pixel that holds the position.
  const Eigen::Vector2f& Nearest(float x, float y) const {
    const int column = std::clamp(static_cast<int>(x), 0, width_ - 1);
    const int row = std::clamp(static_cast<int>(y), 0, height_ - 1);
    return gradients_[static_cast<size_t>(row) * width_ + column];
  }

 private:
  int width_, height_;
  std::vector<Eigen::Vector2f> gradients_;  // row by row
};

}  // namespace holba
