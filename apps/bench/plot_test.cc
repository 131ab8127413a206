// SPDX-License-Identifier: BSD-3-Clause
#include "apps/bench/plot.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <regex>

namespace holba {
namespace {

using ::testing::DoubleNear;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::Pointwise;
using ::testing::SizeIs;

struct Circle {
  double x, y, radius;
};
std::vector<Circle> CirclesOf(const std::string& svg) {
  const std::regex pattern("<circle cx=\"([-0-9.]+)\" cy=\"([-0-9.]+)\" r=\"([0-9.]+)\"");
  std::vector<Circle> circles;
  for (std::sregex_iterator it(svg.begin(), svg.end(), pattern), end; it != end; ++it)
    circles.push_back({std::stod((*it)[1]), std::stod((*it)[2]), std::stod((*it)[3])});
  return circles;
}

TEST(RoundTicks, AreRoundAndWithin) {
  EXPECT_THAT(RoundTicks(0, 10, 5), Pointwise(DoubleNear(1e-12), {0., 2., 4., 6., 8., 10.}));
  EXPECT_THAT(RoundTicks(-0.31, 0.42, 4), Pointwise(DoubleNear(1e-12), {-0.2, 0.0, 0.2, 0.4}));
  EXPECT_THAT(RoundTicks(1234, 1240, 3), Pointwise(DoubleNear(1e-9), {1234., 1236., 1238., 1240.}));
}

TEST(LogarithmicPlot, MakesAPowerLawAStraightLine) {
  PlotPanel panel{"dense", "images", "ms", {{"Point", {}}}};
  for (const double n : {10.0, 100.0, 1000.0}) panel.lines[0].points.push_back({n, 0.01 * n * n});
  const std::vector<Circle> circles = CirclesOf(LogarithmicPlot({&panel, 1}));
  ASSERT_THAT(circles, SizeIs(4));  // and that of the legend
  EXPECT_NEAR(circles[1].x - circles[0].x, circles[2].x - circles[1].x, 0.2);
  EXPECT_NEAR(circles[1].y - circles[0].y, circles[2].y - circles[1].y, 0.2);
  EXPECT_LT(circles[2].y, circles[0].y) << "up is more";
}

TEST(LogarithmicPlot, LeavesOutWhatHasNoLogarithm) {
  const PlotPanel panel{"t", "x", "y", {{"a", {{0.0, 1.0}, {10.0, 1.0}, {20.0, -1.0}}}}};
  EXPECT_THAT(CirclesOf(LogarithmicPlot({&panel, 1})), SizeIs(2));
}

TEST(DotPlot, HasADotOfEveryCaseAndOneOfEachMean) {
  SeedTable table("t", "", {"alone", "with <groups> & all"}, {"a", "b"}, {{"share, %"}, {"mm"}});
  table.values[0] = {{10.0, 20.0}, {1.0, 1.0}};
  table.values[1] = {{12.0, 24.0}, {1.0, std::numeric_limits<double>::quiet_NaN()}};
  const std::string svg = DotPlot(table);
  EXPECT_THAT(CirclesOf(svg), SizeIs(7 + 4));
  EXPECT_THAT(svg, HasSubstr("with &lt;groups> &amp; all"));
  EXPECT_THAT(svg, Not(HasSubstr("nan")));
  EXPECT_EQ(svg, DotPlot(table));
  // The mean lies in the middle of its two cases.
  const std::vector<Circle> circles = CirclesOf(svg);
  EXPECT_NEAR(circles[2].x, 0.5 * (circles[0].x + circles[1].x), 0.11);
}

}  // namespace
}  // namespace holba
