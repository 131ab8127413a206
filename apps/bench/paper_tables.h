// SPDX-License-Identifier: BSD-3-Clause
// The figures that the paper reports, under the names of the benchmarks' tables, rows and measures.
#pragma once

#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "apps/bench/seed_table.h"

namespace holba {

// What a row is compared with where the paper's order of rows is looked for in ours.
enum class OrderAgainst { kPreviousRow, kLastRow };

struct PaperTable {
  std::string_view table;  // SeedTable::name
  std::string_view place;  // "Table 2, Hypersim"
  std::vector<std::string_view> measures;
  struct Row {
    std::string_view name;       // of ours
    std::vector<double> values;  // of the measures
  };
  std::vector<Row> rows;  // in the paper's order
  OrderAgainst order = OrderAgainst::kPreviousRow;
};

const std::vector<PaperTable>& PaperTables();
// Null: the paper has no figures for it.
const PaperTable* FindPaperTable(std::string_view table);

// The differences between two rows of the paper beside ours, case by case.
enum class Verdict { kHolds, kUndecided, kOtherWay };  // undecided: within one standard error
struct OrderFinding {
  std::string better_row, worse_row, measure;  // as the paper has them
  Spread difference;                           // of ours, better less worse
  int digits = 1;
  Verdict verdict = Verdict::kUndecided;
};
// One for each measure and pair of compared rows that differ in the paper and that ours has in
// common cases. The better row is the one that the measure's direction says.
std::vector<OrderFinding> CompareOrder(const SeedTable& ours, const PaperTable& paper);

}  // namespace holba
