// SPDX-License-Identifier: BSD-3-Clause
#include "apps/bench/paper_tables.h"

#include <algorithm>
#include <cmath>

namespace holba {
namespace {

OrderFinding Judge(const SeedTable& ours, size_t better, size_t worse, size_t measure,
                   const Spread& difference) {
  const bool more_is_better = ours.measures[measure].better == BetterIs::kHigher;
  const double gain = more_is_better ? difference.mean : -difference.mean;
  OrderFinding finding = {ours.rows[better], ours.rows[worse], ours.measures[measure].name,
                          difference, ours.measures[measure].digits};
  if (std::abs(gain) > difference.StandardError())
    finding.verdict = gain > 0.0 ? Verdict::kHolds : Verdict::kOtherWay;
  return finding;
}

}  // namespace

const std::vector<PaperTable>& PaperTables() {
  static const std::vector<PaperTable> tables = {
      {"geometry_points",
       "Table 2, 8 scenes of Hypersim",
       {"within @1 mm, %", "within @5 mm, %", "within @10 mm, %", "median, mm"},
       {{"each point and line by itself", {9.3, 31.7, 45.6, 15.10}},
        {"groups", {11.5, 35.6, 48.5, 13.80}},
        {"groups and wireframe", {11.9, 36.3, 48.9, 13.55}}}},
      {"geometry_lines",
       "Table 2, 8 scenes of Hypersim",
       {"recall @1 mm, m", "recall @5 mm, m", "recall @10 mm, m", "precision @1 mm, %",
        "precision @5 mm, %", "precision @10 mm, %"},
       {{"each point and line by itself", {72.1, 222.5, 301.2, 21.3, 59.4, 77.3}},
        {"groups", {93.2, 248.8, 315.5, 27.3, 65.5, 81.0}},
        {"groups and wireframe", {93.3, 249.5, 315.7, 27.3, 65.5, 81.0}}}},
      {"geometry_multi_view",
       "Table 3, 13 scenes of ETH3D",
       {"accuracy @1 cm, %", "accuracy @2 cm, %", "accuracy @5 cm, %", "accuracy @10 cm, %",
        "completeness @1 cm, %", "completeness @2 cm, %", "completeness @5 cm, %",
        "completeness @10 cm, %", "F1 @1 cm, %", "F1 @2 cm, %", "F1 @5 cm, %", "F1 @10 cm, %"},
       {{"each point and line by itself",
         {45.17, 58.70, 75.53, 84.57, 0.14, 0.74, 4.10, 11.09, 0.29, 1.46, 7.66, 19.25}},
        {"groups and wireframe",
         {47.05, 60.59, 76.84, 85.40, 0.15, 0.76, 4.18, 11.21, 0.30, 1.50, 7.81, 19.47}}}},
      {"poses",
       "Table 4, 8 scenes of Hypersim",
       {"AUC @3 deg", "AUC @5 deg", "AUC @10 deg"},
       {{"points, as COLMAP", {89.3, 90.4, 92.2}},
        {"Point-Line", {92.2, 93.2, 94.0}},
        {"Holistic", {92.5, 93.4, 94.2}}}},
      {"ablation",
       "Table 5, accuracy on ETH3D, AUC on ScanNet++",
       {"accuracy @1 cm, %", "accuracy @5 cm, %", "accuracy @10 cm, %", "AUC @1 deg", "AUC @3 deg",
        "AUC @5 deg", "AUC @10 deg"},
       {{"points", {45.17, 75.53, 84.57, 66.1, 84.0, 86.0, 87.5}},
        {"3D, weight 1, pair fixed", {45.17, 75.55, 84.58, 67.4, 85.0, 87.1, 89.1}},
        {"3D, weight 10, pair fixed", {45.24, 75.61, 84.63, 68.1, 85.0, 89.0, 90.5}},
        {"3D, weight 100, pair fixed", {45.72, 76.12, 84.88, 68.3, 87.8, 89.9, 91.1}},
        {"3D, weight 1000, pair fixed", {46.69, 76.71, 85.15, 67.1, 85.1, 87.1, 88.3}},
        {"2D, pair fixed", {47.05, 76.84, 85.40, 69.4, 87.4, 89.4, 90.6}}},
       OrderAgainst::kLastRow},
      // Means of the three scenes; time by that of the point baseline.
      {"sfm_runtime",
       "Table 1, mean of 3 scenes of 1DSfM",
       {"time ratio", "global: iterations"},
       {{"none", {1.0, 4.8}}, {"lines", {1.11, 5.0}}, {"holistic", {1.32, 10.9}}}},
      {"sfm",
       "Table 1, mean of 3 scenes of 1DSfM",
       {"error, px"},
       {{"none", {1.07}}, {"lines", {1.057}}, {"holistic", {1.063}}}},
      {"density",
       "mean of 3 scenes of 1DSfM",
       {"without wireframe, %", "with it, %", "more by, %"},
       {{"collection", {25.7, 26.5, 3.8}}}}};
  return tables;
}

const PaperTable* FindPaperTable(std::string_view table) {
  const auto found = std::find_if(PaperTables().begin(), PaperTables().end(),
                                  [&](const PaperTable& paper) { return paper.table == table; });
  return found == PaperTables().end() ? nullptr : &*found;
}

std::vector<OrderFinding> CompareOrder(const SeedTable& ours, const PaperTable& paper) {
  std::vector<OrderFinding> findings;
  for (size_t i = 0; i < paper.rows.size(); ++i) {
    const bool to_last = paper.order == OrderAgainst::kLastRow;
    if (to_last ? i + 1 == paper.rows.size() : i == 0) continue;
    const PaperTable::Row& row = paper.rows[i];
    const PaperTable::Row& other = to_last ? paper.rows.back() : paper.rows[i - 1];
    const auto row_idx = ours.RowOf(row.name), other_idx = ours.RowOf(other.name);
    if (!row_idx || !other_idx) continue;
    for (size_t m = 0; m < paper.measures.size(); ++m) {
      const auto measure = ours.MeasureOf(paper.measures[m]);
      if (!measure || row.values[m] == other.values[m]) continue;
      const BetterIs better = ours.measures[*measure].better;
      if (better == BetterIs::kNeither) continue;
      const bool row_is_better = (row.values[m] > other.values[m]) == (better == BetterIs::kHigher);
      const size_t best = row_is_better ? *row_idx : *other_idx;
      const size_t worst = row_is_better ? *other_idx : *row_idx;
      const auto difference =
          DifferenceOf(ours.values[best][*measure], ours.values[worst][*measure]);
      if (difference) findings.push_back(Judge(ours, best, worst, *measure, *difference));
    }
  }
  return findings;
}

}  // namespace holba
