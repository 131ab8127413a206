// SPDX-License-Identifier: BSD-3-Clause
#include "apps/bench/table.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "holba/base/check.h"
#include "holba/base/error.h"

namespace holba {
namespace {

bool ArePositive(std::span<const double> values) {
  return std::all_of(values.begin(), values.end(),
                     [](double x) { return x > 0 && std::isfinite(x); });
}

}  // namespace

std::string Table::Markdown() const {
  std::vector<size_t> widths;
  for (const std::string& cell : header) widths.push_back(std::max<size_t>(3, cell.size()));
  for (const auto& row : rows) {
    HOLBA_CHECK_MSG(row.size() == header.size(), "a row does not fit the header of " + title);
    for (size_t i = 0; i < row.size(); ++i) widths[i] = std::max(widths[i], row[i].size());
  }
  const auto line = [&](const std::vector<std::string>& row) {
    std::string text = "|";
    for (size_t i = 0; i < row.size(); ++i) {
      text += i == 0 ? fmt::format(" {:<{}} |", row[i], widths[i])
                     : fmt::format(" {:>{}} |", row[i], widths[i]);
    }
    return text + "\n";
  };
  std::string rule = "|";
  for (size_t i = 0; i < header.size(); ++i) {
    rule += i == 0 ? " " + std::string(widths[i], '-') + " |"
                   : " " + std::string(widths[i] - 1, '-') + ": |";
  }
  std::string text = title.empty() ? "" : title + "\n\n";
  text += line(header) + rule + "\n";
  for (const auto& row : rows) text += line(row);
  return text;
}

std::optional<PairedRatio> CompareInPairs(std::span<const double> values,
                                          std::span<const double> baseline) {
  if (values.empty() || values.size() != baseline.size()) return std::nullopt;
  if (!ArePositive(values) || !ArePositive(baseline)) return std::nullopt;
  PairedRatio result;
  double sum_log = 0.0;
  for (size_t i = 0; i < values.size(); ++i) {
    const double ratio = values[i] / baseline[i];
    sum_log += std::log(ratio);
    result.worst = std::max(result.worst, ratio);
    result.wins += ratio < 1.0;
    ++result.count;
  }
  result.geometric_mean = std::exp(sum_log / result.count);
  return result;
}

std::optional<double> GrowthExponent(std::span<const double> sizes,
                                     std::span<const double> values) {
  if (sizes.size() != values.size() || !ArePositive(sizes) || !ArePositive(values)) {
    return std::nullopt;
  }
  double mean_x = 0.0, mean_y = 0.0;
  for (size_t i = 0; i < sizes.size(); ++i) {
    mean_x += std::log(sizes[i]) / static_cast<double>(sizes.size());
    mean_y += std::log(values[i]) / static_cast<double>(sizes.size());
  }
  double xx = 0.0, xy = 0.0;
  for (size_t i = 0; i < sizes.size(); ++i) {
    const double x = std::log(sizes[i]) - mean_x;
    xx += x * x;
    xy += x * (std::log(values[i]) - mean_y);
  }
  if (!(xx > 1e-12)) return std::nullopt;
  return xy / xx;
}

std::vector<int> WholeNumbers(std::string_view name, std::span<const double> numbers, int low) {
  std::vector<int> whole;
  for (const double number : numbers) {
    if (!(number >= low && number <= std::numeric_limits<int>::max()) ||
        number != std::floor(number)) {
      throw InputError(
          fmt::format("--{0}: expected a whole number at least {2}, found {1}", name, number, low));
    }
    whole.push_back(static_cast<int>(number));
  }
  return whole;
}

std::string ThreeDigits(double value) {
  if (value == 0.0 || !std::isfinite(value)) return fmt::format("{:.0f}", value);
  // The exponent after rounding to three digits: 9.996 has that of 10.0.
  const std::string scientific = fmt::format("{:.2e}", value);
  const int exponent = std::stoi(scientific.substr(scientific.find('e') + 1));
  return fmt::format("{:.{}f}", value, std::max(0, 2 - exponent));
}

}  // namespace holba
