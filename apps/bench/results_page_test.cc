// SPDX-License-Identifier: BSD-3-Clause
#include "apps/bench/results_page.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "apps/temporary_folder_testing.h"
#include "holba/base/error.h"

namespace holba {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;

SeedTable Poses() {
  SeedTable table("poses", "Poses:", {"points, as COLMAP", "Point-Line", "Holistic"},
                  {"a", "b", "c", "d", "e"}, {{"AUC @1 deg"}, {"AUC @3 deg"}});
  table.values[0] = {{1, 2, 3, 4, 5}, {80, 82, 84, 86, 88}};
  table.values[1] = {{1, 2, 3, 4, 5}, {82, 83, 87, 88, 90}};
  table.values[2] = {{1, 2, 3, 4, 5}, {81, 82, 86, 87, 89.5}};
  return table;
}

TEST(ResultsPage, HasThePapersFiguresBesideOurs) {
  const Table table = BesidePaper(Poses());
  EXPECT_THAT(table.rows[0], ElementsAre("points, as COLMAP", "3.0 ± 1.6", "84.0 ± 3.2 (89.3)"));
  EXPECT_THAT(table.title, HasSubstr("Hypersim"));
}

TEST(ResultsPage, SaysWhereTheOrderHoldsAndWhereNot) {
  const std::string text = OrderText(Poses());
  EXPECT_THAT(text, HasSubstr("holds in 1 of 2 comparisons"));
  // 1, 1, 1, 1, 0.5 less.
  EXPECT_THAT(text, HasSubstr("The other way round: AUC @3 deg, \"Holistic\" against "
                              "\"Point-Line\": -0.9 ± 0.1"));
  EXPECT_THAT(text, Not(HasSubstr("Undecided")));
}

TEST(ResultsPage, HoldsWhatIsThereInItsOrder) {
  SeedTable primitives("primitives", "Primitives:", {"PLANE"}, {"0"}, {{"found"}});
  primitives.Set(0, 0, std::vector<double>{3});
  const std::string page =
      ResultsPage({{"primitives", {primitives}}, {"poses", {Poses()}}}, "results");
  EXPECT_THAT(page, HasSubstr("(results/poses.svg)"));
  EXPECT_LT(page.find("--benchmark poses"), page.find("--benchmark primitives"));
  EXPECT_THAT(page, Not(HasSubstr("--benchmark sfm\n")));
  EXPECT_THAT(page, HasSubstr("5 cases: a, b, c, d, e"));
  EXPECT_THAT(page, HasSubstr("Not measured yet, and not on this page: geometry, ablation, sfm"));
}

TEST(ResultsPage, SaysThatFewCasesSettleNothing) {
  SeedTable table = Poses();
  EXPECT_THAT(OrderText(table), Not(HasSubstr("too few")));
  table.cases.resize(2);
  for (auto& row : table.values)
    for (auto& values : row) values.resize(2);
  EXPECT_THAT(OrderText(table), HasSubstr("2 cases are too few to judge by, which needs 5"));
}

class ResultFiles : public TemporaryFolderTest {
 protected:
  void Write(const std::string& name, const std::string& text) const {
    std::ofstream(folder_ / name) << text;
  }
};

TEST_F(ResultFiles, AreReadAsTheyWereWritten) {
  for (const std::string& benchmark : BenchmarksOfPage())
    Write(benchmark + ".json", PaperBenchToJson(benchmark, {{Poses()}, ""}).dump());
  const auto results = ReadResults(folder_);
  EXPECT_EQ(results.size(), BenchmarksOfPage().size());
  EXPECT_EQ(results.at("geometry")[0].values, Poses().values);
}

TEST_F(ResultFiles, ThatAreMissingAreLeftOutAndNoneIsRefused) {
  EXPECT_THROW(ReadResults(folder_), InputError);
  Write("poses.json", PaperBenchToJson("poses", {{Poses()}, ""}).dump());
  EXPECT_EQ(ReadResults(folder_).size(), 1u);
}

TEST_F(ResultFiles, ThatAreNoResultsAreRefused) {
  for (const char* text : {"", "[]", "{}", "{\"tables\": []}", "{\"tables\": [1]}"}) {
    Write("geometry.json", text);
    EXPECT_THROW(ReadResults(folder_), InputError) << text;
  }
}

}  // namespace
}  // namespace holba
