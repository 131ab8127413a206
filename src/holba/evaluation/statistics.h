// SPDX-License-Identifier: BSD-3-Clause
// Summary of a set of errors: root mean square, mean, median (the mean of the middle two for an
// even count, as numpy) and largest value.
#pragma once

#include <cstddef>
#include <optional>
#include <span>

namespace holba {

struct ErrorStats {
  size_t count = 0;
  double rms = 0.0;
  double mean = 0.0;
  double median = 0.0;
  double max = 0.0;
};

// Empty: no errors.
std::optional<ErrorStats> Summarise(std::span<const double> errors);

}  // namespace holba
