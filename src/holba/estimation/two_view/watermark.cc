// SPDX-License-Identifier: BSD-3-Clause
#include "holba/estimation/two_view/watermark.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "holba/base/check.h"
#include "holba/base/random.h"

namespace holba {
namespace {

// Shifts that are tried, each of one match: where 70 % are one shift, 30 wrong ones in a row have a
// probability below 1e-15.
constexpr int kNumTrials = 30;

bool IsInside(const Eigen::Vector2d& pixel, const std::array<uint64_t, 2>& size, double share) {
  const double width = static_cast<double>(size[0]), height = static_cast<double>(size[1]);
  const double border = share * std::hypot(width, height);
  return pixel.x() > border && pixel.x() < width - border && pixel.y() > border &&
         pixel.y() < height - border;
}

size_t CountNear(const std::vector<Eigen::Vector2d>& shifts, const Eigen::Vector2d& shift,
                 double max_error_px) {
  return static_cast<size_t>(
      std::count_if(shifts.begin(), shifts.end(), [&](const Eigen::Vector2d& s) {
        return (s - shift).squaredNorm() <= max_error_px * max_error_px;
      }));
}

}  // namespace

bool LooksLikeWatermark(const WatermarkRule& rule, const std::array<uint64_t, 2>& size1,
                        std::span<const Eigen::Vector2d> pixels1,
                        const std::array<uint64_t, 2>& size2,
                        std::span<const Eigen::Vector2d> pixels2, uint64_t seed) {
  HOLBA_CHECK(pixels1.size() == pixels2.size());
  if (pixels1.empty()) return false;
  const double enough = rule.min_inlier_ratio * static_cast<double>(pixels1.size());
  std::vector<Eigen::Vector2d> shifts;
  size_t num_in_border = 0;
  for (size_t i = 0; i < pixels1.size(); ++i) {
    if (!IsInside(pixels1[i], size1, rule.border_size) &&
        !IsInside(pixels2[i], size2, rule.border_size)) {
      ++num_in_border;
    }
    shifts.push_back(pixels2[i] - pixels1[i]);
  }
  if (static_cast<double>(num_in_border) < enough) return false;

  Random random(seed);
  for (int trial = 0; trial < kNumTrials; ++trial) {
    const Eigen::Vector2d& shift = shifts[random.Index(shifts.size())];
    // Once more about the mean of those near it: the first is off by its own error.
    Eigen::Vector2d sum = Eigen::Vector2d::Zero();
    size_t count = 0;
    for (const Eigen::Vector2d& s : shifts) {
      if ((s - shift).squaredNorm() > rule.max_error_px * rule.max_error_px) continue;
      sum += s;
      ++count;
    }
    const Eigen::Vector2d mean = sum / static_cast<double>(count);
    if (static_cast<double>(CountNear(shifts, mean, rule.max_error_px)) >= enough) return true;
  }
  return false;
}

}  // namespace holba
