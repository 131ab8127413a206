// SPDX-License-Identifier: BSD-3-Clause
#include "apps/report.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace holba {
namespace {

using testing::HasSubstr;
using testing::Not;

BundleSummary SummaryOf(bool angular_term) {
  BundleSummary summary;
  TermCost term;
  term.term = angular_term ? "vp" : "point";
  term.residuals = 4;
  term.angular = angular_term;
  summary.solver.initial_terms = summary.solver.final_terms = {term};
  summary.angular_weight_factor = 0.25;
  return summary;
}

TEST(Report, SaysNothingOfWeightsThatWereNotChosen) {
  const BundleSummary summary = SummaryOf(false);
  EXPECT_TRUE(SummaryToJson(summary).at("camera_weights").is_null());
  EXPECT_THAT(SummaryToText(summary), Not(HasSubstr("cameras moved by")));
}

TEST(Report, TellsWhatMovedTheCamerasAndOnWhatEvidence) {
  BundleSummary summary = SummaryOf(false);
  WeightChoice& choice = summary.weight_choice;
  choice.num_tracks = 321;
  choice.trials = {{{.points_alone = true}, {}}, {{.structure = {4.0, 1.0, 0.25}}, {-0.02, 0.003}}};
  choice.weights = choice.trials[1].weights;
  const auto json = SummaryToJson(summary).at("camera_weights");
  EXPECT_EQ(json.at("lines"), 4.0);
  EXPECT_EQ(json.at("groups"), 0.25);
  EXPECT_EQ(json.at("tracks_left_out"), 321);
  EXPECT_EQ(json.at("trials").at(1).at("cost_from_points"), -0.02);
  EXPECT_THAT(SummaryToText(summary),
              HasSubstr("cameras moved by lines x 4, corners x 1, groups x 0.25: 321 tracks that were "
                        "left out cost -0.0200 +- 0.0030 each against points alone"));
  choice.weights = choice.trials[0].weights;
  choice.without_unverified = true;
  EXPECT_EQ(SummaryToJson(summary).at("camera_weights").at("points_alone"), true);
  EXPECT_THAT(SummaryToText(summary), HasSubstr("cameras moved by points alone: "));
  EXPECT_THAT(SummaryToText(summary), HasSubstr("points that only two images see"));
}

TEST(Report, TellsTheFactorOfAngularTermsWhereThereAreAny) {
  EXPECT_EQ(SummaryToJson(SummaryOf(true)).at("angular_weight_factor"), 0.25);
  EXPECT_THAT(SummaryToText(SummaryOf(true)), HasSubstr("angular terms times 0.25"));
  EXPECT_THAT(SummaryToText(SummaryOf(false)), Not(HasSubstr("angular")));
}

}  // namespace
}  // namespace holba
