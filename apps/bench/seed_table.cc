// SPDX-License-Identifier: BSD-3-Clause
#include "apps/bench/seed_table.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "holba/base/check.h"
#include "holba/base/error.h"

namespace holba {
namespace {

constexpr double kNotMeasured = std::numeric_limits<double>::quiet_NaN();
constexpr const char* kBetterNames[] = {"higher", "lower", "neither"};

std::vector<std::string> HeaderOf(const SeedTable& table) {
  std::vector<std::string> header = {""};
  for (const SeedMeasure& measure : table.measures) header.push_back(measure.name);
  return header;
}

Table MeansOf(const SeedTable& table) {
  Table means = {table.title, HeaderOf(table), {}};
  for (size_t r = 0; r < table.rows.size(); ++r) {
    std::vector<std::string> row = {table.rows[r]};
    for (size_t m = 0; m < table.measures.size(); ++m)
      row.push_back(SpreadText(SpreadOf(table.values[r][m]), table.measures[m].digits));
    means.rows.push_back(std::move(row));
  }
  return means;
}

// Of measures that have a better and a worse.
Table DifferencesOf(const SeedTable& table) {
  Table differences = {
      fmt::format("Differences from \"{}\" case by case, with the standard error of their mean:",
                  table.rows[0]),
      {""},
      {}};
  for (size_t r = 1; r < table.rows.size(); ++r) differences.rows.push_back({table.rows[r]});
  for (size_t m = 0; m < table.measures.size(); ++m) {
    const SeedMeasure& measure = table.measures[m];
    if (measure.better == BetterIs::kNeither) continue;
    differences.header.push_back(measure.name);
    for (size_t r = 1; r < table.rows.size(); ++r) {
      differences.rows[r - 1].push_back(
          DifferenceText(DifferenceOf(table.values[r][m], table.values[0][m]), measure.digits));
    }
  }
  return differences;
}

template <typename Named>
std::optional<size_t> IndexOfName(const std::vector<Named>& list, std::string_view name,
                                  const std::string& (*name_of)(const Named&)) {
  const auto found = std::find_if(list.begin(), list.end(),
                                  [&](const Named& named) { return name_of(named) == name; });
  if (found == list.end()) return std::nullopt;
  return static_cast<size_t>(found - list.begin());
}

}  // namespace

double Spread::StandardError() const {
  return count == 0 ? 0.0 : deviation / std::sqrt(static_cast<double>(count));
}

std::optional<Spread> SpreadOf(std::span<const double> values) {
  Spread spread;
  for (const double value : values) {
    if (!std::isfinite(value)) continue;
    spread.mean += value;
    ++spread.count;
  }
  if (spread.count == 0) return std::nullopt;
  spread.mean /= static_cast<double>(spread.count);
  double sum_squares = 0.0;
  for (const double value : values) {
    if (std::isfinite(value)) sum_squares += (value - spread.mean) * (value - spread.mean);
  }
  if (spread.count > 1)
    spread.deviation = std::sqrt(sum_squares / static_cast<double>(spread.count - 1));
  return spread;
}

std::optional<Spread> DifferenceOf(std::span<const double> values,
                                   std::span<const double> baseline) {
  HOLBA_CHECK(values.size() == baseline.size());
  std::vector<double> differences;
  // Of what is not finite no difference is.
  for (size_t i = 0; i < values.size(); ++i) differences.push_back(values[i] - baseline[i]);
  return SpreadOf(differences);
}

SeedTable::SeedTable(std::string name, std::string title, std::vector<std::string> rows,
                     std::vector<std::string> cases, std::vector<SeedMeasure> measures)
    : name(std::move(name)),
      title(std::move(title)),
      rows(std::move(rows)),
      cases(std::move(cases)),
      measures(std::move(measures)),
      values(this->rows.size(),
             std::vector<std::vector<double>>(
                 this->measures.size(), std::vector<double>(this->cases.size(), kNotMeasured))) {}

std::optional<size_t> SeedTable::RowOf(std::string_view row) const {
  return IndexOfName<std::string>(
      rows, row, [](const std::string& text) -> const std::string& { return text; });
}

std::optional<size_t> SeedTable::MeasureOf(std::string_view measure) const {
  return IndexOfName<SeedMeasure>(
      measures, measure, [](const SeedMeasure& m) -> const std::string& { return m.name; });
}

void SeedTable::Set(size_t row, size_t case_idx, std::span<const double> of_measures) {
  HOLBA_CHECK(row < rows.size() && case_idx < cases.size() &&
              of_measures.size() == measures.size());
  for (size_t m = 0; m < of_measures.size(); ++m) values[row][m][case_idx] = of_measures[m];
}

std::string SpreadText(const std::optional<Spread>& spread, int digits) {
  if (!spread) return "-";
  const std::string mean = fmt::format("{:.{}f}", spread->mean, digits);
  if (spread->count < 2) return mean;
  return fmt::format("{} ± {:.{}f}", mean, spread->deviation, digits);
}

std::string DifferenceText(const std::optional<Spread>& difference, int digits) {
  if (!difference) return "-";
  const std::string mean = fmt::format("{:+.{}f}", difference->mean, digits);
  if (difference->count < 2) return mean;
  return fmt::format("{} ± {:.{}f}", mean, difference->StandardError(), digits);
}

std::vector<Table> TablesOf(const SeedTable& table) {
  std::vector<Table> tables = {MeansOf(table)};
  if (table.rows.size() < 2 || table.cases.size() < 2) return tables;
  Table differences = DifferencesOf(table);
  if (differences.header.size() > 1) tables.push_back(std::move(differences));
  return tables;
}

nlohmann::ordered_json SeedTableToJson(const SeedTable& table) {
  nlohmann::ordered_json json;
  json["name"] = table.name;
  json["title"] = table.title;
  json["cases"] = table.cases;
  json["measures"] = nlohmann::ordered_json::array();
  for (const SeedMeasure& measure : table.measures) {
    json["measures"].push_back({{"name", measure.name},
                                {"better", kBetterNames[static_cast<size_t>(measure.better)]},
                                {"digits", measure.digits}});
  }
  json["rows"] = nlohmann::ordered_json::array();
  for (size_t r = 0; r < table.rows.size(); ++r) {
    nlohmann::ordered_json of_measures;
    for (size_t m = 0; m < table.measures.size(); ++m) {
      nlohmann::ordered_json& of_measure = of_measures[table.measures[m].name];
      of_measure["values"] = nlohmann::ordered_json::array();
      // What is not finite has no number in JSON.
      for (const double value : table.values[r][m]) {
        of_measure["values"].push_back(std::isfinite(value) ? nlohmann::ordered_json(value)
                                                            : nlohmann::ordered_json(nullptr));
      }
      if (const auto spread = SpreadOf(table.values[r][m])) {
        of_measure["mean"] = spread->mean;
        of_measure["deviation"] = spread->deviation;
      }
      if (r == 0) continue;
      if (const auto difference = DifferenceOf(table.values[r][m], table.values[0][m])) {
        of_measure["from_first_row"] = {{"mean", difference->mean},
                                        {"standard_error", difference->StandardError()}};
      }
    }
    json["rows"].push_back({{"name", table.rows[r]}, {"measures", std::move(of_measures)}});
  }
  return json;
}

SeedTable SeedTableFromJson(const nlohmann::json& json, const std::filesystem::path& path) {
  try {
    std::vector<SeedMeasure> measures;
    for (const nlohmann::json& measure : json.at("measures")) {
      const auto found = std::find(std::begin(kBetterNames), std::end(kBetterNames),
                                   measure.at("better").get<std::string>());
      if (found == std::end(kBetterNames)) throw std::out_of_range("better");
      measures.push_back({measure.at("name"),
                          static_cast<BetterIs>(found - std::begin(kBetterNames)),
                          measure.at("digits")});
    }
    std::vector<std::string> rows;
    for (const nlohmann::json& row : json.at("rows")) rows.push_back(row.at("name"));
    SeedTable table(json.at("name"), json.at("title"), std::move(rows), json.at("cases"),
                    std::move(measures));
    for (size_t r = 0; r < table.rows.size(); ++r) {
      for (size_t m = 0; m < table.measures.size(); ++m) {
        const nlohmann::json& values =
            json.at("rows").at(r).at("measures").at(table.measures[m].name).at("values");
        if (values.size() != table.cases.size()) throw std::out_of_range("values");
        for (size_t c = 0; c < values.size(); ++c) {
          if (!values[c].is_null()) table.values[r][m][c] = values[c].get<double>();
        }
      }
    }
    return table;
  } catch (const std::exception&) {
    throw InputError(
        path, "this is no table of results; make the file anew with 'holba bench --output_path'");
  }
}

}  // namespace holba
