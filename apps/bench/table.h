// SPDX-License-Identifier: BSD-3-Clause
// What the benchmarks print and compare with: Markdown tables, paired ratios, lists of sizes.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace holba {

struct Table {
  std::string title;  // a line above the table; may be empty
  std::vector<std::string> header;
  std::vector<std::vector<std::string>> rows;  // as many cells as the header

  // Columns of equal width, the first one left-aligned, the others right-aligned.
  std::string Markdown() const;
};

// Values against a baseline of the same cases: smaller is better.
struct PairedRatio {
  double geometric_mean = 0.0;
  double worst = 0.0;  // the largest
  int wins = 0;        // cases below 1
  int count = 0;
};
// Empty: no cases, sequences of different lengths, or a value that is not positive.
std::optional<PairedRatio> CompareInPairs(std::span<const double> values,
                                          std::span<const double> baseline);

// Slope of log(values) over log(sizes), by least squares: the exponent of growth. Empty: fewer than
// two different sizes, or a number that is not positive.
std::optional<double> GrowthExponent(std::span<const double> sizes, std::span<const double> values);

// The numbers of option --NAME as whole ones. Throws InputError if one is not whole or below `low`.
std::vector<int> WholeNumbers(std::string_view name, std::span<const double> numbers, int low);

// Three significant digits, never in exponent form: "0.0123", "4.56", "1234".
std::string ThreeDigits(double value);

}  // namespace holba
