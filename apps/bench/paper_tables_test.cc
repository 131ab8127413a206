// SPDX-License-Identifier: BSD-3-Clause
#include "apps/bench/paper_tables.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <set>

namespace holba {
namespace {

using ::testing::IsEmpty;
using ::testing::SizeIs;

// Rows a, b, c get better in x, which is higher, and in y, which is lower; b and c tie in y.
const PaperTable kPaper = {
    "t", "", {"x", "y"}, {{"a", {1, 9}}, {"b", {2, 8}}, {"c", {3, 8}}}, OrderAgainst::kPreviousRow};

SeedTable Ours() {
  SeedTable table("t", "", {"a", "b", "c"}, {"1", "2", "3"},
                  {{"x", BetterIs::kHigher}, {"y", BetterIs::kLower}});
  table.values[0] = {{10, 20, 30}, {5, 6, 7}};
  table.values[1] = {{11, 21, 32}, {5.1, 5.9, 7}};
  table.values[2] = {{9, 18, 31}, {1, 1, 1}};
  return table;
}

TEST(PaperTables, HaveAFigureForEachMeasureOfEachRow) {
  std::set<std::string_view> names;
  for (const PaperTable& paper : PaperTables()) {
    EXPECT_TRUE(names.insert(paper.table).second) << paper.table;
    EXPECT_EQ(FindPaperTable(paper.table), &paper);
    for (const PaperTable::Row& row : paper.rows)
      EXPECT_THAT(row.values, SizeIs(paper.measures.size())) << paper.table << ", " << row.name;
  }
  EXPECT_EQ(FindPaperTable("none of these"), nullptr);
}

TEST(CompareOrder, JudgesBySignAndStandardErrorOfPairedDifferences) {
  const std::vector<OrderFinding> findings = CompareOrder(Ours(), kPaper);
  ASSERT_THAT(findings, SizeIs(3)) << "b and c tie in y";
  // b - a in x: 1, 1, 2. Standard error 1 / 3.
  EXPECT_EQ(findings[0].measure, "x");
  EXPECT_EQ(findings[0].better_row, "b");
  EXPECT_EQ(findings[0].verdict, Verdict::kHolds);
  EXPECT_NEAR(findings[0].difference.mean, 4.0 / 3.0, 1e-12);
  EXPECT_NEAR(findings[0].difference.StandardError(), 1.0 / 3.0, 1e-12);
  // b - a in y: 0.1, -0.1, 0.
  EXPECT_EQ(findings[1].verdict, Verdict::kUndecided);
  // c - b in x: -2, -3, -1.
  EXPECT_EQ(findings[2].better_row, "c");
  EXPECT_EQ(findings[2].verdict, Verdict::kOtherWay);
}

TEST(CompareOrder, TurnsWithTheMeasuresDirection) {
  SeedTable table = Ours();
  table.measures[0].better = BetterIs::kLower;
  const std::vector<OrderFinding> findings = CompareOrder(table, kPaper);
  EXPECT_EQ(findings[0].better_row, "a") << "the paper has it lower";
  EXPECT_EQ(findings[0].verdict, Verdict::kHolds) << "and so have we, by 4 / 3";
  EXPECT_NEAR(findings[0].difference.mean, -4.0 / 3.0, 1e-12);
}

TEST(CompareOrder, LeavesOutWhatOursHasNot) {
  SeedTable table = Ours();
  table.measures[0].better = BetterIs::kNeither;
  table.rows[2] = "d";
  EXPECT_THAT(CompareOrder(table, kPaper), SizeIs(1));
  for (double& value : table.values[0][1]) value = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(CompareOrder(table, kPaper), IsEmpty());
}

TEST(CompareOrder, AgainstTheLastRowComparesEachWithIt) {
  PaperTable paper = kPaper;
  paper.order = OrderAgainst::kLastRow;
  const std::vector<OrderFinding> findings = CompareOrder(Ours(), paper);
  ASSERT_THAT(findings, SizeIs(3));
  for (const OrderFinding& finding : findings) EXPECT_EQ(finding.better_row, "c");
}

}  // namespace
}  // namespace holba
