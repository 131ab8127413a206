// SPDX-License-Identifier: BSD-3-Clause
#include "holba/estimation/lines/line_leave_one_out.h"

#include <gtest/gtest.h>

#include "holba/estimation/lines/line_testing.h"
#include "holba/estimation/lines/lines_from_segments.h"

namespace holba {
namespace {

TEST(LeaveOneOut, IsZeroForExactSegments) {
  TestHouse house = MakeTestHouse({});
  BuildLines({}, house.features, nullptr, 1, &house.model);
  const LeaveOneOutReport report = LeaveOneOut(house.model, 4, 1);
  EXPECT_EQ(report.num_lines, house.edges.size());
  EXPECT_EQ(report.distances_px.size(), 8 * house.edges.size());
  EXPECT_LT(report.median_px, 1e-5);
  EXPECT_EQ(report.share_below_1_px, 1.0);
  EXPECT_EQ(report.share_above_3_px, 0.0);
  EXPECT_EQ(report.no_fit, 0u);
}

// The left-out segment deviates by its own noise and by that of the line.
TEST(LeaveOneOut, IsAboveTheNoiseWhereResidualsAreBelow) {
  constexpr double kNoisePx = 0.3;
  TestHouse house = MakeTestHouse({.noise_px = kNoisePx});
  BuildLines({}, house.features, nullptr, 1, &house.model);
  const LeaveOneOutReport report = LeaveOneOut(house.model, 4, 2);
  double left_out = 0.0;
  for (double d : report.distances_px) left_out += d / report.distances_px.size();
  // Mean of |x| of a normal variable.
  const double mean_noise = kNoisePx * std::sqrt(2.0 / 3.14159265);
  EXPECT_GT(left_out, mean_noise);
  EXPECT_LT(left_out, 1.35 * mean_noise);
  double residuals = 0.0;
  for (const auto& [id, line] : house.model.lines3D)
    residuals += line.error / house.model.lines3D.size();
  EXPECT_LT(residuals, kNoisePx);
}

TEST(LeaveOneOut, SeesAWrongSegmentThatTheOthersContradict) {
  TestHouse house = MakeTestHouse({});
  BuildLines({}, house.features, nullptr, 1, &house.model);
  Line3D& line = house.model.lines3D.begin()->second;
  const LineObservation wrong = line.track[0];
  LineSegment2d& segment = house.model.images.at(wrong.image_id).lines2D[wrong.line2D_idx].segment;
  const Eigen::Vector2d across = segment.Line().head<2>();
  segment.start += 5.0 * across;
  segment.end += 5.0 * across;
  const LeaveOneOutReport report = LeaveOneOut(house.model, 4, 1);
  EXPECT_NEAR(report.distances_px[0], 5.0, 1e-4);
  EXPECT_NEAR(report.share_above_3_px, 1.0 / report.distances_px.size(), 1e-12);
}

TEST(LeaveOneOut, CountsLinesOfTooFewImages) {
  TestHouse house = MakeTestHouse({});
  BuildLines({}, house.features, nullptr, 1, &house.model);
  const LeaveOneOutReport report = LeaveOneOut(house.model, 9, 1);
  EXPECT_EQ(report.too_few_images, house.edges.size());
  EXPECT_EQ(report.num_lines, 0u);
  EXPECT_TRUE(LeaveOneOut(Reconstruction(), 3, 1).distances_px.empty());
}

}  // namespace
}  // namespace holba
