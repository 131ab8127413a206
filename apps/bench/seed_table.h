// SPDX-License-Identifier: BSD-3-Clause
// Figures of a benchmark by method (a row), measure and case: scenes or seeds that all methods see,
// so that methods are compared case by case. As tables, as JSON and back.
#pragma once

#include <cstddef>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "apps/bench/table.h"

namespace holba {

// Of the same quantity in several cases.
struct Spread {
  double mean = 0.0;
  double deviation = 0.0;  // standard deviation of one case, over n - 1; 0 for one case
  size_t count = 0;

  double StandardError() const;  // of the mean
};
// Values that are not finite do not count. Empty: none is left.
std::optional<Spread> SpreadOf(std::span<const double> values);
// Of values less those of a baseline in the same cases; pairs of which either is not finite do not
// count.
std::optional<Spread> DifferenceOf(std::span<const double> values,
                                   std::span<const double> baseline);

enum class BetterIs { kHigher, kLower, kNeither };

struct SeedMeasure {
  std::string name;  // with its unit: "points @1 mm, %"
  BetterIs better = BetterIs::kHigher;
  int digits = 1;  // behind the point
};

struct SeedTable {
  std::string name;   // "geometry"
  std::string title;  // a line above
  std::vector<std::string> rows, cases;
  std::vector<SeedMeasure> measures;
  std::vector<std::vector<std::vector<double>>> values;  // [row][measure][case]; NaN: not measured

  SeedTable() = default;
  // Every value NaN.
  SeedTable(std::string name, std::string title, std::vector<std::string> rows,
            std::vector<std::string> cases, std::vector<SeedMeasure> measures);

  // Empty: no such row or measure.
  std::optional<size_t> RowOf(std::string_view row) const;
  std::optional<size_t> MeasureOf(std::string_view measure) const;
  // One case of a row, in the order of the measures.
  void Set(size_t row, size_t case_idx, std::span<const double> of_measures);
};

// "12.3 ± 0.4"; "-" without a value, without the deviation where there is one case.
std::string SpreadText(const std::optional<Spread>& spread, int digits);
// "+1.2 ± 0.3", the mean and its standard error.
std::string DifferenceText(const std::optional<Spread>& difference, int digits);

// Means and deviations; where there are several rows and cases also the differences of the rows
// from the first one, case by case, with the standard errors of their means, of measures of which
// more or less is better.
std::vector<Table> TablesOf(const SeedTable& table);

nlohmann::ordered_json SeedTableToJson(const SeedTable& table);
// Throws InputError naming `path` for what no SeedTableToJson wrote.
SeedTable SeedTableFromJson(const nlohmann::json& json, const std::filesystem::path& path);

}  // namespace holba
