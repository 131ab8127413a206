// SPDX-License-Identifier: BSD-3-Clause
#include "holba/estimation/lines/line_triangulation.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "holba/base/random.h"
#include "holba/estimation/lines/line_support_testing.h"

namespace holba {
namespace {

using ::testing::ElementsAreArray;

constexpr double kAnySigma = 1e9;

TEST(TriangulateLine, IsTheEdgeWithItsExtent) {
  const TestHouse house = MakeTestHouse({});
  for (size_t e = 0; e < house.edges.size(); ++e) {
    const std::vector<LineSupport> supports = SupportsOfEdge(house, static_cast<int>(e));
    const auto line = TriangulateLine(supports, {}, 3, kAnySigma);
    ASSERT_TRUE(line) << e;
    const auto& [a, b] = house.edges[e];
    EXPECT_LT(line->line.Pluecker().Distance(a), 1e-6);
    EXPECT_LT(line->line.Pluecker().Distance(b), 1e-6);
    EXPECT_EQ(line->num_images, supports.size());
    // The segments show 96 % of the edge.
    EXPECT_NEAR(line->t_end - line->t_start, 0.96 * (b - a).norm(), 1e-6);
  }
}

TEST(TriangulateLine, WrongMatchesAreFoundOut) {
  const TestHouse house = MakeTestHouse({.noise_px = 0.2});
  Random random(4);
  for (int e = 0; e < 6; ++e) {
    std::vector<LineSupport> supports = SupportsOfEdge(house, e);
    std::vector<bool> is_right(supports.size(), true);
    // As many of other edges, from images that show the right one, too.
    for (int i = 0; i < 4; ++i) {
      const std::vector<LineSupport> others = SupportsOfEdge(
          house,
          static_cast<int>((e + 1 + random.Index(house.edges.size() - 1)) % house.edges.size()));
      supports.push_back(others[random.Index(others.size())]);
      is_right.push_back(false);
    }
    const auto line = TriangulateLine(supports, {}, 3, kAnySigma);
    ASSERT_TRUE(line);
    EXPECT_THAT(line->is_inlier, ElementsAreArray(is_right));
    EXPECT_LT(line->line.Pluecker().Distance(house.edges[e].first), 0.02);
  }
}

TEST(TriangulateLine, NothingFromOneImageOrFromTooFew) {
  const TestHouse house = MakeTestHouse({});
  const std::vector<LineSupport> supports = SupportsOfEdge(house, 0);
  const std::vector<LineSupport> twice = {supports[0], supports[0]};
  EXPECT_FALSE(TriangulateLine(twice, {}, 2, kAnySigma));
  const std::vector<LineSupport> two = {supports[0], supports[4]};
  EXPECT_TRUE(TriangulateLine(two, {}, 2, kAnySigma));
  EXPECT_FALSE(TriangulateLine(two, {}, 3, kAnySigma));
  // Known to no better than a hundredth of a per mille of its depth by segments of half a pixel.
  EXPECT_FALSE(TriangulateLine(supports, {}, 3, 1e-5));
}

TEST(ShowsLine, NeedsBothEndsNearAndAPartInCommon) {
  const TestHouse house = MakeTestHouse({});
  LineSupport support = SupportsOfEdge(house, 2)[0];
  const auto& [a, b] = house.edges[2];
  const AnchoredLine line{(b - a).normalized(), a};
  const double length = (b - a).norm();
  EXPECT_TRUE(ShowsLine(support, line, 0.0, length, 1.5, 0.3));
  EXPECT_FALSE(ShowsLine(support, line, 2.0 * length, 3.0 * length, 1.5, 0.3));
  const Eigen::Vector2d across = LineSegment2d{support.start, support.end}.Line().head<2>();
  support.start += 2.0 * across;
  EXPECT_FALSE(ShowsLine(support, line, 0.0, length, 1.5, 0.3));
  EXPECT_TRUE(ShowsLine(support, line, 0.0, length, 2.5, 0.3));
}

}  // namespace
}  // namespace holba
