// SPDX-License-Identifier: BSD-3-Clause
// Pictures of known geometry for the tests of segments and corners.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <numbers>

#include "holba/base/random.h"
#include "holba/frontend/photographs/photograph.h"

namespace holba {

// Brightness as a function of the position (centre of the first pixel: 0.5), with Gaussian noise.
inline GreyImage Picture(int width, int height, double noise,
                         const std::function<double(const Eigen::Vector2d&)>& brightness) {
  Random random(7);
  GreyImage image{width, height, {}};
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const double value =
          brightness({x + 0.5, y + 0.5}) + (noise > 0.0 ? noise * random.Normal() : 0.0);
      image.pixels.push_back(static_cast<uint8_t>(std::clamp(std::lround(value), 0l, 255l)));
    }
  }
  return image;
}

// 0 left of an edge, 1 right of it, blurred as by a lens.
inline double BlurredStep(double distance_px, double blur_px = 0.7) {
  return 0.5 * std::erfc(-distance_px / (blur_px * std::numbers::sqrt2));
}

// A rectangle turned by an angle.
struct Rectangle {
  Eigen::Vector2d centre, half_size;
  double angle_rad = 0.0;

  Eigen::Vector2d Along() const { return {std::cos(angle_rad), std::sin(angle_rad)}; }
  Eigen::Vector2d Across() const { return {-std::sin(angle_rad), std::cos(angle_rad)}; }
  // 1 inside, 0 outside.
  double At(const Eigen::Vector2d& position) const {
    const Eigen::Vector2d d = position - centre;
    const double u = d.dot(Along()), v = d.dot(Across());
    return BlurredStep(half_size.x() - u) * BlurredStep(half_size.x() + u) *
           BlurredStep(half_size.y() - v) * BlurredStep(half_size.y() + v);
  }
  // In a row around it.
  Eigen::Vector2d Corner(int i) const {
    const double su = i == 0 || i == 3 ? -1.0 : 1.0, sv = i < 2 ? -1.0 : 1.0;
    return centre + su * half_size.x() * Along() + sv * half_size.y() * Across();
  }
};

}  // namespace holba
