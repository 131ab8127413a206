// SPDX-License-Identifier: BSD-3-Clause
// The upper median, and what it says of a normal distribution.
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

namespace holba {

// Standard deviation of a normal distribution of mean 0 over the median of its absolute values.
inline constexpr double kSigmaPerMedian = 1.4826;

// 0 of nothing.
inline double Median(std::vector<double> values) {
  if (values.empty()) return 0.0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace holba
