// SPDX-License-Identifier: BSD-3-Clause
#include "holba/estimation/lines/segment_grid.h"

#include <gtest/gtest.h>

#include <limits>
#include <set>

#include "holba/base/random.h"

namespace holba {
namespace {

double PointDistance(const Eigen::Vector2d& p, const LineSegment2d& s) {
  const Eigen::Vector2d along = s.end - s.start;
  const double t = std::clamp(along.dot(p - s.start) / along.squaredNorm(), 0.0, 1.0);
  return (s.start + t * along - p).norm();
}

std::vector<LineSegment2d> RandomSegments(int count, Random* random) {
  std::vector<LineSegment2d> segments;
  for (int i = 0; i < count; ++i) {
    const Eigen::Vector2d start(random->Uniform(0, 800), random->Uniform(0, 600));
    const double angle = random->Uniform(0, 6.283), length = random->Uniform(5, 300);
    segments.push_back({start, start + length * Eigen::Vector2d(std::cos(angle), std::sin(angle))});
  }
  return segments;
}

TEST(SegmentGrid, FindsAllThatComeNear) {
  Random random(3);
  const std::vector<LineSegment2d> segments = RandomSegments(300, &random);
  const SegmentGrid grid(segments, 24.0, 3.0);
  size_t visits = 0;
  for (const LineSegment2d& query : RandomSegments(100, &random)) {
    std::set<uint32_t> found;
    grid.ForEachNear(query, [&](uint32_t i) {
      found.insert(i);
      ++visits;
    });
    for (uint32_t i = 0; i < segments.size(); ++i) {
      bool near = false;
      for (double t = 0.0; t <= 1.0; t += 0.01)
        near |= PointDistance(query.start + t * (query.end - query.start), segments[i]) <= 3.0;
      if (near) {
        EXPECT_TRUE(found.contains(i));
      }
    }
  }
  // And not all others.
  EXPECT_GT(visits, 0u);
}

TEST(SegmentGrid, ShortQueriesVisitFewSegments) {
  Random random(4);
  std::vector<LineSegment2d> segments;
  for (int x = 0; x < 40; ++x) {
    for (int y = 0; y < 30; ++y)
      segments.push_back({Eigen::Vector2d(20 * x, 20 * y), Eigen::Vector2d(20 * x + 10, 20 * y)});
  }
  const SegmentGrid grid(segments, 24.0, 3.0);
  std::set<uint32_t> found;
  grid.ForEachNear({Eigen::Vector2d(400, 300), Eigen::Vector2d(420, 300)},
                   [&](uint32_t i) { found.insert(i); });
  EXPECT_TRUE(found.contains(20 * 30 + 15));
  EXPECT_LT(found.size(), 40u);
}

TEST(SegmentGrid, EmptyFarAndUndefinedQueriesVisitNothing) {
  size_t visits = 0;
  const auto count = [&](uint32_t) { ++visits; };
  SegmentGrid().ForEachNear({Eigen::Vector2d(0, 0), Eigen::Vector2d(10, 0)}, count);
  SegmentGrid({}, 24.0, 3.0).ForEachNear({Eigen::Vector2d(0, 0), Eigen::Vector2d(10, 0)}, count);
  const LineSegment2d one{Eigen::Vector2d(0, 0), Eigen::Vector2d(100, 50)};
  const SegmentGrid grid(std::span(&one, 1), 24.0, 3.0);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  grid.ForEachNear({Eigen::Vector2d(1e9, 1e9), Eigen::Vector2d(2e9, 1e9)}, count);
  grid.ForEachNear({Eigen::Vector2d(nan, 0), Eigen::Vector2d(nan, 0)}, count);
  EXPECT_EQ(visits, 0u);
  grid.ForEachNear({Eigen::Vector2d(50, 25), Eigen::Vector2d(50, 25)}, count);
  EXPECT_EQ(visits, 1u);
}

}  // namespace
}  // namespace holba
