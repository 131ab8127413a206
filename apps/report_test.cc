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

TEST(Report, SaysNothingOfCamerasThatWereNotTested) {
  const BundleSummary summary = SummaryOf(false);
  EXPECT_TRUE(SummaryToJson(summary).at("camera_shift_sigmas").is_null());
  EXPECT_THAT(SummaryToText(summary), Not(HasSubstr("cameras")));
}

TEST(Report, TellsCamerasThatMovedFromCamerasThatWereHeld) {
  BundleSummary summary = SummaryOf(false);
  summary.camera_shift_sigmas = 1.5;
  EXPECT_EQ(SummaryToJson(summary).at("camera_shift_sigmas"), 1.5);
  EXPECT_EQ(SummaryToJson(summary).at("cameras_held"), false);
  EXPECT_THAT(SummaryToText(summary), HasSubstr("cameras moved by 1.50 "));
  summary.cameras_held = true;
  EXPECT_EQ(SummaryToJson(summary).at("cameras_held"), true);
  EXPECT_THAT(SummaryToText(summary), HasSubstr("cameras held: "));
}

TEST(Report, TellsTheFactorOfAngularTermsWhereThereAreAny) {
  EXPECT_EQ(SummaryToJson(SummaryOf(true)).at("angular_weight_factor"), 0.25);
  EXPECT_THAT(SummaryToText(SummaryOf(true)), HasSubstr("angular terms times 0.25"));
  EXPECT_THAT(SummaryToText(SummaryOf(false)), Not(HasSubstr("angular")));
}

}  // namespace
}  // namespace holba
