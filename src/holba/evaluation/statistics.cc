// SPDX-License-Identifier: BSD-3-Clause
#include "holba/evaluation/statistics.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace holba {

std::optional<ErrorStats> Summarise(std::span<const double> errors) {
  if (errors.empty()) return std::nullopt;
  ErrorStats stats;
  stats.count = errors.size();
  double sum = 0.0, sum_squares = 0.0;
  for (const double e : errors) {
    sum += e;
    sum_squares += e * e;
    stats.max = std::max(stats.max, e);
  }
  const double n = static_cast<double>(errors.size());
  stats.mean = sum / n;
  stats.rms = std::sqrt(sum_squares / n);
  std::vector<double> sorted(errors.begin(), errors.end());
  const auto middle = sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2);
  std::nth_element(sorted.begin(), middle, sorted.end());
  stats.median = *middle;
  if (sorted.size() % 2 == 0) {
    stats.median = 0.5 * (*middle + *std::max_element(sorted.begin(), middle));
  }
  return stats;
}

}  // namespace holba
