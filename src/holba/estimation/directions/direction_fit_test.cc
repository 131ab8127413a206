// SPDX-License-Identifier: BSD-3-Clause
#include "holba/estimation/directions/direction_fit.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>
#include <vector>

#include "holba/base/random.h"

namespace holba {
namespace {

Eigen::Matrix3d Calibration() {
  Eigen::Matrix3d K;
  K << 700, 0, 405, 0, 690, 295, 0, 0, 1;
  return K;
}

Eigen::Matrix3d SomeRotation(Random* random) {
  return Eigen::Quaterniond(random->Normal(), random->Normal(), random->Normal(), random->Normal())
      .normalized()
      .toRotationMatrix();
}

LineSegment2d SomeSegment(Random* random) {
  const Eigen::Vector2d middle(random->Uniform(0, 800), random->Uniform(0, 600));
  const Eigen::Vector2d half(random->Uniform(-40, 40), random->Uniform(-40, 40));
  return {middle - half, middle + half};
}

// Segment along the image of a direction, moved aside by `error_px` at its ends, in opposite
// senses.
LineSegment2d SegmentTowards(const Eigen::Vector3d& d, const Eigen::Matrix3d& KR, double error_px,
                             Random* random) {
  const Eigen::Vector2d middle(random->Uniform(0, 800), random->Uniform(0, 600));
  const Eigen::Vector3d v = KR * d;
  const Eigen::Vector2d along = (v.head<2>() - v.z() * middle).normalized();
  const Eigen::Vector2d aside(-along.y(), along.x());
  const Eigen::Vector2d half = random->Uniform(15, 40) * along + error_px * aside;
  return {middle - half, middle + half};
}

TEST(DirectionEvidence, ErrorIsTheDistanceOfTheEndsFromTheLineToTheVanishingPoint) {
  Random random(1);
  for (int trial = 0; trial < 100; ++trial) {
    const Eigen::Matrix3d KR = Calibration() * SomeRotation(&random);
    const LineSegment2d segment = SomeSegment(&random);
    const Eigen::Vector3d d(random.Normal(), random.Normal(), random.Normal());
    const Eigen::Vector2d middle = 0.5 * (segment.start + segment.end);
    const Eigen::Vector3d line = middle.homogeneous().cross(KR * d);
    const double distance = std::abs(line.dot(segment.start.homogeneous())) / line.head<2>().norm();
    const DirectionEvidence evidence(segment, KR);
    EXPECT_NEAR(std::sqrt(evidence.SquaredError(d)), distance, 1e-7);
    EXPECT_NEAR(std::sqrt(evidence.SquaredError(-3.0 * d)), distance, 1e-7);
    EXPECT_NEAR(evidence.SquaredDistance(d),
                ((KR * d).head<2>() - (KR * d).z() * middle).squaredNorm(),
                1e-9 * (KR * d).squaredNorm());
  }
}

TEST(DirectionEvidence, ALineNeverReachesItsVanishingPoint) {
  const Eigen::Matrix3d K = Calibration();
  const DirectionEvidence evidence({{100, 100}, {200, 100}}, K);
  const auto direction = [&](double x) {
    return Eigen::Vector3d(K.inverse() * Eigen::Vector3d(x, 100, 1));
  };
  for (const double x : {101.0, 150.0, 199.0}) {
    EXPECT_TRUE(std::isinf(evidence.SquaredError(direction(x)))) << x;
  }
  for (const double x : {99.0, 201.0, 1e4}) {
    EXPECT_NEAR(evidence.SquaredError(direction(x)), 0.0, 1e-12) << x;
  }
}

TEST(RefineDirection, IsExactInSeveralViewsInSpiteOfOutliers) {
  Random random(2);
  for (int trial = 0; trial < 20; ++trial) {
    const Eigen::Vector3d d =
        Eigen::Vector3d(random.Normal(), random.Normal(), random.Normal()).normalized();
    std::vector<DirectionEvidence> evidence;
    for (int view = 0; view < 4; ++view) {
      const Eigen::Matrix3d KR = Calibration() * SomeRotation(&random);
      for (int i = 0; i < 15; ++i) evidence.emplace_back(SegmentTowards(d, KR, 0, &random), KR);
      for (int i = 0; i < 5; ++i) evidence.emplace_back(SegmentTowards(d, KR, 3.0, &random), KR);
    }
    const Eigen::Vector3d start = (d + 0.003 * d.unitOrthogonal()).normalized();
    const auto refined = RefineDirection(evidence, 1.0, start);
    ASSERT_TRUE(refined);
    EXPECT_LT(refined->cross(d).norm(), 1e-7);
    EXPECT_GT(refined->dot(d), 0.0) << "the sense of the start";
  }
}

TEST(RefineDirection, IsEmptyWhereTheSegmentsDoNotFixIt) {
  const Eigen::Matrix3d K = Calibration();
  const DirectionEvidence one({{100, 100}, {200, 100}}, K), other({{100, 300}, {200, 300}}, K);
  const Eigen::Vector3d x = Eigen::Vector3d::UnitX();
  EXPECT_FALSE(RefineDirection({}, 1.0, x));
  EXPECT_FALSE(RefineDirection(std::vector{one}, 1.0, x));
  EXPECT_FALSE(RefineDirection(std::vector{one, one}, 1.0, x));
  EXPECT_FALSE(RefineDirection(std::vector{one, other}, 1.0, Eigen::Vector3d::UnitY()))
      << "no segment agrees with the start";
  const auto refined = RefineDirection(std::vector{one, other}, 1.0, x);
  ASSERT_TRUE(refined);
  EXPECT_LT(refined->cross(x).norm(), 1e-9);
}

}  // namespace
}  // namespace holba
