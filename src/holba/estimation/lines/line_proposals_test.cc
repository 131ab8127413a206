// SPDX-License-Identifier: BSD-3-Clause
#include "holba/estimation/lines/line_proposals.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>

#include "holba/base/random.h"

namespace holba {
namespace {

struct Example {
  SegmentPlane segment, other;
  Eigen::Vector3d start, end;  // truth
  double length_start, length_end;
};

Eigen::Vector3d Any(Random* random, double size) {
  const double x = random->Normal(size), y = random->Normal(size), z = random->Normal(size);
  return {x, y, z};
}

SegmentPlane See(const Eigen::Vector3d& centre, const Eigen::Vector3d& a,
                 const Eigen::Vector3d& b) {
  const Eigen::Vector3d u = (a - centre).normalized(), v = (b - centre).normalized();
  return {centre, u, v, u.cross(v).normalized()};
}

Example Make(uint64_t seed) {
  Random random(seed);
  Example e;
  e.start = Any(&random, 1.0) + Eigen::Vector3d(0, 0, 8);
  e.end = Any(&random, 1.0) + Eigen::Vector3d(0, 0, 8);
  const Eigen::Vector3d c1 = Any(&random, 1.0), c2 = Any(&random, 1.0);
  e.segment = See(c1, e.start, e.end);
  // The other sees another piece of the line.
  const Eigen::Vector3d across = e.end - e.start;
  e.other = See(c2, e.start + 0.3 * across, e.end + 0.4 * across);
  e.length_start = (e.start - c1).norm();
  e.length_end = (e.end - c1).norm();
  return e;
}

void ExpectTruth(const Example& e, const std::optional<RayLengths>& lengths) {
  ASSERT_TRUE(lengths.has_value());
  EXPECT_NEAR(lengths->start, e.length_start, 1e-6 * e.length_start);
  EXPECT_NEAR(lengths->end, e.length_end, 1e-6 * e.length_end);
}

TEST(Proposals, OfConsistentInputAreTheTruth) {
  for (uint64_t seed = 1; seed <= 50; ++seed) {
    const Example e = Make(seed);
    const Eigen::Vector3d across = e.end - e.start;
    Eigen::Vector4d plane;
    plane << e.other.normal, -e.other.normal.dot(e.other.centre);
    ExpectTruth(e, ProposeOnPlane(e.segment, plane, 1e-9));
    ExpectTruth(e, ProposeOnLine(e.segment, e.start + 0.7 * across, -2.0 * across));
    const Eigen::Vector3d points[] = {e.start - 0.2 * across, e.start + 0.5 * across, e.end};
    ExpectTruth(e, ProposeThroughPoints(e.segment, points));
    ExpectTruth(e, ProposeThroughPoint(e.segment, e.start + 0.4 * across, e.other));
    ExpectTruth(e, ProposeAlong(e.segment, -3.0 * across, e.other));
  }
}

// Of a point off the segment's plane: the ends are collinear with its projection, and no other
// choice comes nearer to the other plane.
TEST(Proposals, ThroughAPointIsTheLeastDistanceFromTheOtherPlane) {
  int tested = 0;
  for (uint64_t seed = 1; seed <= 30; ++seed) {
    Example e = Make(seed);
    Random random(seed + 100);
    const Eigen::Vector3d point = e.start + 0.4 * (e.end - e.start) + Any(&random, 0.05);
    const auto lengths = ProposeThroughPoint(e.segment, point, e.other);
    if (!lengths) continue;
    const Eigen::Vector3d on_plane =
        point - e.segment.normal.dot(point - e.segment.centre) * e.segment.normal;
    const auto cost = [&](double start, double end) {
      const Eigen::Vector3d a = e.segment.centre + start * e.segment.ray_start;
      const Eigen::Vector3d b = e.segment.centre + end * e.segment.ray_end;
      const double da = e.other.normal.dot(a - e.other.centre);
      const double db = e.other.normal.dot(b - e.other.centre);
      return da * da + db * db;
    };
    const Eigen::Vector3d a = e.segment.centre + lengths->start * e.segment.ray_start;
    const Eigen::Vector3d b = e.segment.centre + lengths->end * e.segment.ray_end;
    EXPECT_LT((a - on_plane).normalized().cross((b - on_plane).normalized()).norm(), 1e-6);
    const double least = cost(lengths->start, lengths->end);
    // All lines through the point, by their length along the first ray.
    for (double start = 0.5; start < 20.0; start += 0.01) {
      const Eigen::Vector3d s = e.segment.centre + start * e.segment.ray_start;
      const auto other = ProposeOnLine(e.segment, on_plane, on_plane - s);
      if (other) {
        EXPECT_GE(cost(other->start, other->end), least - 1e-9);
      }
    }
    ++tested;
  }
  EXPECT_GE(tested, 20);
}

TEST(Proposals, BehindOrAlongTheRaysAreNone) {
  const Example e = Make(3);
  const Eigen::Vector3d view = (e.start - e.segment.centre).normalized();
  Eigen::Vector4d behind;
  behind << view, -view.dot(e.segment.centre - view);
  EXPECT_FALSE(ProposeOnPlane(e.segment, behind, 1e-9).has_value());
  Eigen::Vector4d through_centre;
  through_centre << e.segment.normal, -e.segment.normal.dot(e.segment.centre);
  EXPECT_FALSE(ProposeOnPlane(e.segment, through_centre, 0.01).has_value());
  EXPECT_FALSE(ProposeOnLine(e.segment, e.start, e.segment.ray_end).has_value());
  EXPECT_FALSE(ProposeOnLine(e.segment, e.start, e.segment.normal).has_value());
  EXPECT_FALSE(ProposeThroughPoints(e.segment, {}).has_value());
  const Eigen::Vector3d same[] = {e.start, e.start};
  EXPECT_FALSE(ProposeThroughPoints(e.segment, same).has_value());
}

}  // namespace
}  // namespace holba
