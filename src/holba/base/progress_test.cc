// SPDX-License-Identifier: BSD-3-Clause
#include "holba/base/progress.h"

#include <gtest/gtest.h>

namespace holba {
namespace {

TEST(Progress, SaysTheRateAndTheTimeLeft) {
  EXPECT_EQ(ProgressText("Extracting", "images", 0, 340, 1.0),
            "Extracting [------------------------] 0 / 340 images");
  EXPECT_EQ(ProgressText("Extracting", "images", 40, 340, 20.0),
            "Extracting [##----------------------] 40 / 340 images, 2.00 images/s, 2:30 left");
  EXPECT_EQ(
      ProgressText("Extracting", "images", 10, 72010, 10.0),
      "Extracting [------------------------] 10 / 72010 images, 1.00 images/s, 20:00:00 left");
  EXPECT_EQ(ProgressText("Matching", "pairs", 340, 340, 10.0),
            "Matching [########################] 340 / 340 pairs, 34 pairs/s");
}

TEST(Progress, FitsTheTerminal) {
  EXPECT_EQ(ProgressText("Extracting", "images", 40, 340, 20.0, 20), "Extracting [##------");
}

TEST(Progress, IsNotShownUnlessAProgramAsksForIt) {
  testing::internal::CaptureStderr();
  {
    Progress progress("Extracting", "images", 3);
    progress.Update(1);
    progress.Advance();
    ClearProgressLine();
  }
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
}

}  // namespace
}  // namespace holba
