// SPDX-License-Identifier: BSD-3-Clause
#include "apps/bench/accuracy.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

namespace holba {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::SizeIs;

class Accuracy : public ::testing::Test {
 protected:
  Accuracy() {
    options_.visibilities = {Visibility::kRandom, Visibility::kNear};
    options_.num_seeds = 2;
    options_.scene.num_images = 20;
    options_.bundle[TermFamily::kPoint].loss = LossChoice::kTrivial;
    options_.bundle[TermFamily::kLine].loss = LossChoice::kTrivial;
    options_.bundle.refine_focal_length = options_.bundle.refine_extra_params = false;
    options_.solver.num_threads = 1;
  }
  AccuracyOptions options_;
};

TEST_F(Accuracy, HasOneErrorOfEachMeasureMethodAndSeed) {
  const std::vector<AccuracyResult> results = MeasureAccuracy(options_);
  ASSERT_THAT(results, SizeIs(2));
  for (const AccuracyResult& result : results) {
    std::vector<std::string> methods;
    for (const AccuracyRow& row : result.rows) {
      methods.push_back(row.method);
      ASSERT_THAT(row.errors, SizeIs(AccuracyMeasures().size()));
      for (const auto& errors : row.errors) EXPECT_THAT(errors, SizeIs(2));
      EXPECT_THAT(row.iterations, SizeIs(row.method == "Start" ? 0 : 2));
      for (size_t m = 0; m < row.errors.size() && row.method != "Start"; ++m) {
        for (int seed = 0; seed < 2; ++seed) {
          EXPECT_LT(row.errors[m][seed], result.rows[0].errors[m][seed])
              << row.method << ", " << AccuracyMeasures()[m];
        }
      }
    }
    EXPECT_THAT(methods, ElementsAre("Start", "Point", "Point-Line", "Groups", "Holistic",
                                     "Holistic, groups 5, wireframe 1"));
  }
  const std::vector<Table> tables = AccuracyTables(options_, results);
  ASSERT_THAT(tables, SizeIs(4));
  EXPECT_THAT(tables[0].rows, SizeIs(6));
  EXPECT_THAT(tables[1].rows, SizeIs(4));  // Start and Point have no ratio to Point
  EXPECT_THAT(tables[1].title, HasSubstr("random"));
  EXPECT_THAT(tables[3].title, HasSubstr("near"));
}

TEST_F(Accuracy, OfASeedDoesNotDependOnTheSeedsBefore) {
  options_.visibilities = {Visibility::kRandom};
  const AccuracyResult both = MeasureAccuracy(options_)[0];
  options_.scene.seed += 1;
  options_.num_seeds = 1;
  const AccuracyResult second = MeasureAccuracy(options_)[0];
  for (size_t r = 0; r < both.rows.size(); ++r) {
    for (size_t m = 0; m < AccuracyMeasures().size(); ++m) {
      EXPECT_EQ(second.rows[r].errors[m][0], both.rows[r].errors[m][1]);
    }
  }
}

}  // namespace
}  // namespace holba
