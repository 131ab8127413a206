// SPDX-License-Identifier: BSD-3-Clause
// Matches of what is printed on photographs (watermarks, frames, dates) instead of what they show:
// near the border, and shifted all by the same.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <span>

namespace holba {

struct WatermarkRule {
  double border_size = 0.1;       // of the image's diagonal
  double min_inlier_ratio = 0.7;  // share near the border, and share of one shift
  double max_error_px = 4.0;
};

// pixels1[i] and pixels2[i] are a match. `size`: width and height.
bool LooksLikeWatermark(const WatermarkRule& rule, const std::array<uint64_t, 2>& size1,
                        std::span<const Eigen::Vector2d> pixels1,
                        const std::array<uint64_t, 2>& size2,
                        std::span<const Eigen::Vector2d> pixels2, uint64_t seed);

}  // namespace holba
