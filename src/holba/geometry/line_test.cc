// SPDX-License-Identifier: BSD-3-Clause
#include "holba/geometry/line.h"

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cmath>

#include "holba/base/random.h"

namespace holba {
namespace {

constexpr int kTrials = 50;

Eigen::Vector3d RandomVector(Random* random, double sigma = 1.0) {
  return {random->Normal(sigma), random->Normal(sigma), random->Normal(sigma)};
}
Eigen::Quaterniond RandomRotation(Random* random) {
  return Eigen::Quaterniond(random->Normal(), random->Normal(), random->Normal(), random->Normal())
      .normalized();
}

// Unit direction, moment perpendicular to it.
void ExpectPluecker(const PlueckerLine& line) {
  EXPECT_NEAR(line.direction.norm(), 1.0, 1e-14);
  EXPECT_NEAR(line.direction.dot(line.moment), 0.0, 1e-12);
}
void ExpectSameLine(const PlueckerLine& a, const PlueckerLine& b, double tolerance) {
  EXPECT_LT((a.direction - b.direction).norm(), tolerance);
  EXPECT_LT((a.moment - b.moment).norm(), tolerance);
}

TEST(PlueckerLine, IsWorkedByHand) {
  // Parallel to x at (0, 2, 3): m = p x d = (0, 3, -2).
  const PlueckerLine line = PlueckerLine::FromPoints({7, 2, 3}, {9, 2, 3});
  EXPECT_EQ(line.direction, Eigen::Vector3d(1, 0, 0));
  EXPECT_EQ(line.moment, Eigen::Vector3d(0, 3, -2));
  EXPECT_EQ(line.Foot(), Eigen::Vector3d(0, 2, 3));
  EXPECT_EQ(line.ClosestPoint({5, 5, 7}), Eigen::Vector3d(5, 2, 3));
  EXPECT_DOUBLE_EQ(line.Distance({5, 5, 7}), 5.0);
}

TEST(PlueckerLine, GoesThroughThePointsItIsMadeOf) {
  Random random(1);
  for (int trial = 0; trial < kTrials; ++trial) {
    const Eigen::Vector3d a = RandomVector(&random, 3), b = RandomVector(&random, 3);
    const PlueckerLine line = PlueckerLine::FromPoints(a, b);
    ExpectPluecker(line);
    EXPECT_GT(line.direction.dot(b - a), 0.0);
    for (const double t : {-3.0, 0.0, 0.5, 1.0, 10.0}) {
      const Eigen::Vector3d p = a + t * (b - a);
      EXPECT_LT(line.Distance(p), 1e-12);
      EXPECT_LT((p.cross(line.direction) - line.moment).norm(), 1e-12);
      ExpectSameLine(PlueckerLine::FromPointDirection(p, 4.2 * (b - a)), line, 1e-12);
    }
  }
}

TEST(PlueckerLine, FootAndClosestPointAreNearest) {
  Random random(2);
  for (int trial = 0; trial < kTrials; ++trial) {
    const PlueckerLine line =
        PlueckerLine::FromPointDirection(RandomVector(&random, 3), RandomVector(&random));
    const Eigen::Vector3d x = RandomVector(&random, 3), closest = line.ClosestPoint(x);
    EXPECT_LT(line.Distance(closest), 1e-13);
    EXPECT_NEAR((x - closest).dot(line.direction), 0.0, 1e-13);
    EXPECT_NEAR(line.Foot().dot(line.direction), 0.0, 1e-13);
    EXPECT_LT((line.Foot() - line.ClosestPoint(Eigen::Vector3d::Zero())).norm(), 1e-13);
    EXPECT_NEAR(line.Foot().norm(), line.moment.norm(), 1e-13);
    // Another formula for the distance: |(x x d) - m| for a unit direction.
    EXPECT_NEAR(line.Distance(x), (x.cross(line.direction) - line.moment).norm(), 1e-13);
  }
}

TEST(PlueckerLine, ThroughTheOriginIsALineLikeAnyOther) {
  const PlueckerLine line = PlueckerLine::FromPoints({1, 2, 2}, {-1, -2, -2});
  ExpectPluecker(line);
  EXPECT_LT(line.moment.norm(), 1e-15);
  EXPECT_LT(line.Foot().norm(), 1e-15);
  EXPECT_LT((line.ClosestPoint({2, 4, 4}) - Eigen::Vector3d(2, 4, 4)).norm(), 1e-14);
  const Rigid3d b_from_a(Eigen::Quaterniond(0.4, -0.1, 0.3, 0.8).normalized(), {1, -2, 0.5});
  const PlueckerLine moved = Transform(b_from_a, line);
  ExpectPluecker(moved);
  EXPECT_LT(moved.Distance(b_from_a.translation), 1e-14);
  ExpectSameLine(Transform(b_from_a.Inverse(), moved), line, 1e-14);
}

TEST(PlueckerLine, LengthOfTheCoordinatesDoesNotMatterToDistances) {
  const PlueckerLine line = PlueckerLine::FromPoints({7, 2, 3}, {9, 1, 5});
  const PlueckerLine scaled = {3.0 * line.direction, 3.0 * line.moment};
  const Eigen::Vector3d x(1, -1, 4);
  EXPECT_NEAR(scaled.Distance(x), line.Distance(x), 1e-14);
  EXPECT_LT((scaled.Foot() - line.Foot()).norm(), 1e-14);
}

TEST(Transform, OfALineIsTheLineThroughTheTransformedPoints) {
  Random random(3);
  for (int trial = 0; trial < kTrials; ++trial) {
    const Eigen::Vector3d a = RandomVector(&random, 3), b = RandomVector(&random, 3);
    const PlueckerLine line = PlueckerLine::FromPoints(a, b);
    Rigid3d rigid(RandomRotation(&random), RandomVector(&random, 5));
    ExpectSameLine(Transform(rigid, line), PlueckerLine::FromPoints(rigid * a, rigid * b), 1e-11);
    ExpectPluecker(Transform(rigid, line));
    rigid.rotation.coeffs() *= 0.7;  // as read from a file
    ExpectSameLine(Transform(rigid, line), PlueckerLine::FromPoints(rigid * a, rigid * b), 1e-11);
    Sim3d sim;
    sim.scale = std::exp(random.Normal());
    sim.rotation = RandomRotation(&random);
    sim.translation = RandomVector(&random, 5);
    ExpectSameLine(Transform(sim, line), PlueckerLine::FromPoints(sim * a, sim * b), 1e-10);
    ExpectPluecker(Transform(sim, line));
  }
}

TEST(Transform, OfALineComposesAndInverts) {
  Random random(4);
  for (int trial = 0; trial < kTrials; ++trial) {
    const PlueckerLine line =
        PlueckerLine::FromPointDirection(RandomVector(&random, 3), RandomVector(&random));
    const Rigid3d b_from_a(RandomRotation(&random), RandomVector(&random, 5));
    const Rigid3d c_from_b(RandomRotation(&random), RandomVector(&random, 5));
    ExpectSameLine(Transform(c_from_b * b_from_a, line),
                   Transform(c_from_b, Transform(b_from_a, line)), 1e-12);
    ExpectSameLine(Transform(b_from_a.Inverse(), Transform(b_from_a, line)), line, 1e-12);
    Sim3d sim;
    sim.scale = 2.5;
    sim.rotation = RandomRotation(&random);
    sim.translation = RandomVector(&random, 5);
    ExpectSameLine(Transform(sim.Inverse(), Transform(sim, line)), line, 1e-12);
  }
}

TEST(Transform, SimilarityOfWorldAndPoseKeepsTheInterpretationPlane) {
  Random random(5);
  for (int trial = 0; trial < kTrials; ++trial) {
    const PlueckerLine line =
        PlueckerLine::FromPointDirection(RandomVector(&random, 3), RandomVector(&random));
    const Rigid3d cam_from_old(RandomRotation(&random), RandomVector(&random, 5));
    Sim3d new_from_old;
    new_from_old.scale = std::exp(random.Normal());
    new_from_old.rotation = RandomRotation(&random);
    new_from_old.translation = RandomVector(&random, 5);
    const PlueckerLine before = Transform(cam_from_old, line);
    const PlueckerLine after =
        Transform(new_from_old.TransformPose(cam_from_old), Transform(new_from_old, line));
    // Image lines are moments up to scale.
    EXPECT_LT((after.moment - new_from_old.scale * before.moment).norm(), 1e-11);
    EXPECT_LT((after.direction - before.direction).norm(), 1e-13);
  }
}

TEST(LineSegment2d, LineGivesSignedDistancesInPixels) {
  const LineSegment2d segment{{10, 20}, {40, 60}};
  EXPECT_DOUBLE_EQ(segment.Length(), 50.0);
  const Eigen::Vector3d line = segment.Line();
  EXPECT_NEAR(line.head<2>().norm(), 1.0, 1e-15);
  EXPECT_NEAR(line.dot(segment.start.homogeneous()), 0.0, 1e-13);
  EXPECT_NEAR(line.dot(segment.end.homogeneous()), 0.0, 1e-13);
  // 5 pixels along the normal (-4, 3)/5 from the middle, and back.
  EXPECT_NEAR(line.dot(Eigen::Vector3d(25 - 4, 40 + 3, 1)), 5.0, 1e-13);
  EXPECT_NEAR(line.dot(Eigen::Vector3d(25 + 4, 40 - 3, 1)), -5.0, 1e-13);
  const LineSegment2d reversed{segment.end, segment.start};
  EXPECT_LT((reversed.Line() + line).norm(), 1e-13);
}

}  // namespace
}  // namespace holba
