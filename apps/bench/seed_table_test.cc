// SPDX-License-Identifier: BSD-3-Clause
#include "apps/bench/seed_table.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "holba/base/error.h"

namespace holba {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::SizeIs;

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

SeedTable TwoRows() {
  SeedTable table("points", "Points:", {"alone", "groups"}, {"a", "b", "c"},
                  {{"share, %", BetterIs::kHigher, 1}, {"median, mm", BetterIs::kLower, 2}});
  table.values[0] = {{10.0, 20.0, 60.0}, {1.0, 2.0, 3.0}};
  table.values[1] = {{11.0, 22.0, 63.0}, {1.0, kNone, 2.0}};
  return table;
}

TEST(Spread, IsTheMeanAndTheDeviationOfASample) {
  const auto spread = SpreadOf(std::vector<double>{2, 4, 4, 4, 5, 5, 7, 9});
  ASSERT_TRUE(spread);
  EXPECT_DOUBLE_EQ(spread->mean, 5.0);
  EXPECT_DOUBLE_EQ(spread->deviation, std::sqrt(32.0 / 7.0));
  EXPECT_DOUBLE_EQ(spread->StandardError(), std::sqrt(4.0 / 7.0));
}

TEST(Spread, LeavesOutWhatIsNotFinite) {
  const auto spread =
      SpreadOf(std::vector<double>{1, kNone, 3, std::numeric_limits<double>::infinity()});
  ASSERT_TRUE(spread);
  EXPECT_EQ(spread->count, 2u);
  EXPECT_EQ(spread->mean, 2.0);
  EXPECT_FALSE(SpreadOf(std::vector<double>{kNone}));
}

TEST(Difference, DoesNotSeeWhatBothHaveInCommon) {
  // The cases differ by far more than the methods.
  const std::vector<double> baseline = {1, 100, 10000, -5}, values = {3, 101, 10003, -3};
  const auto difference = DifferenceOf(values, baseline);
  ASSERT_TRUE(difference);
  EXPECT_DOUBLE_EQ(difference->mean, 2.0);
  EXPECT_DOUBLE_EQ(difference->deviation, std::sqrt(2.0 / 3.0));
  EXPECT_DOUBLE_EQ(difference->StandardError(), std::sqrt(2.0 / 3.0) / 2.0);
}

TEST(Difference, ChangesItsSignWithTheOrderAndIsZeroFromItself) {
  const std::vector<double> a = {1, 4, 2.5, kNone}, b = {2, 2, 2, 2};
  EXPECT_DOUBLE_EQ(DifferenceOf(a, b)->mean, -DifferenceOf(b, a)->mean);
  EXPECT_DOUBLE_EQ(DifferenceOf(a, b)->deviation, DifferenceOf(b, a)->deviation);
  EXPECT_EQ(DifferenceOf(a, b)->count, 3u);
  EXPECT_EQ(DifferenceOf(a, a)->mean, 0.0);
  EXPECT_EQ(DifferenceOf(a, a)->deviation, 0.0);
}

TEST(SeedTable, HasMeansWithDeviationsAndDifferencesWithStandardErrors) {
  const std::vector<Table> tables = TablesOf(TwoRows());
  ASSERT_THAT(tables, SizeIs(2));
  EXPECT_THAT(tables[0].rows[0], ElementsAre("alone", "30.0 ± 26.5", "2.00 ± 1.00"));
  EXPECT_THAT(tables[1].title, HasSubstr("alone"));
  ASSERT_THAT(tables[1].rows, SizeIs(1));
  EXPECT_THAT(tables[1].rows[0], ElementsAre("groups", "+2.0 ± 0.6", "-0.50 ± 0.50"));
}

TEST(SeedTable, HasNoDifferencesOfWhatIsNeitherBetterNorWorse) {
  SeedTable table = TwoRows();
  table.measures[0].better = BetterIs::kNeither;
  EXPECT_THAT(TablesOf(table)[1].header, ElementsAre("", "median, mm"));
  table.measures[1].better = BetterIs::kNeither;
  EXPECT_THAT(TablesOf(table), SizeIs(1));
}

TEST(SeedTable, OfOneCaseHasNoDeviationsAndNoDifferences) {
  SeedTable table("t", "", {"a", "b"}, {"1"}, {{"x"}});
  table.Set(0, 0, std::vector<double>{1.5});
  const std::vector<Table> tables = TablesOf(table);
  ASSERT_THAT(tables, SizeIs(1));
  EXPECT_THAT(tables[0].rows[0], ElementsAre("a", "1.5"));
  EXPECT_THAT(tables[0].rows[1], ElementsAre("b", "-"));
}

TEST(SeedTable, IsTheSameAfterJson) {
  const SeedTable table = TwoRows();
  const std::string text = SeedTableToJson(table).dump();
  const SeedTable read = SeedTableFromJson(nlohmann::json::parse(text), "t.json");
  EXPECT_EQ(read.name, table.name);
  EXPECT_EQ(read.rows, table.rows);
  EXPECT_EQ(read.cases, table.cases);
  EXPECT_EQ(read.measures[1].better, BetterIs::kLower);
  EXPECT_EQ(read.values[0], table.values[0]);
  EXPECT_TRUE(std::isnan(read.values[1][1][1]));
  EXPECT_EQ(SeedTableToJson(read).dump(), text);
}

TEST(SeedTable, RefusesOtherJson) {
  nlohmann::json json = SeedTableToJson(TwoRows());
  json["cases"].push_back("d");
  EXPECT_THROW(SeedTableFromJson(json, "t.json"), InputError);
  EXPECT_THROW(SeedTableFromJson(nlohmann::json::array(), "t.json"), InputError);
}

TEST(SeedTable, FindsRowsAndMeasuresByName) {
  EXPECT_EQ(TwoRows().RowOf("groups"), 1u);
  EXPECT_EQ(TwoRows().MeasureOf("median, mm"), 1u);
  EXPECT_FALSE(TwoRows().RowOf("wireframe"));
}

}  // namespace
}  // namespace holba
