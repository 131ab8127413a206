// SPDX-License-Identifier: BSD-3-Clause
#include "holba/estimation/pose/p3p.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "holba/base/random.h"
#include "holba/estimation/pose/pose_testing.h"

namespace holba {
namespace {

using Eigen::Vector3d;

struct Triple {
  Rigid3d cam_from_world;
  std::array<Vector3d, 3> rays, points;
};

Triple MakeTriple(Random* random, double spread) {
  Triple triple;
  triple.cam_from_world = {ExpRotation(2.0 * RandomTestVector(random)).normalized(),
                           5.0 * RandomTestVector(random)};
  for (int k = 0; k < 3; ++k) {
    const Vector3d in_cam = Vector3d(spread * random->Normal(), spread * random->Normal(), 1.0) *
                            random->Uniform(2.0, 8.0);
    triple.rays[k] = in_cam.normalized();
    triple.points[k] = triple.cam_from_world.Inverse() * in_cam;
  }
  return triple;
}

TEST(SolveP3P, OneOfThePosesIsTheTruth) {
  Random random(3);
  int num_missed = 0;
  for (int trial = 0; trial < 20000; ++trial) {
    const Triple triple = MakeTriple(&random, 0.5);
    std::vector<Rigid3d> poses;
    SolveP3P(triple.rays, triple.points, &poses);
    ASSERT_LE(poses.size(), 4u);
    double best = 1e9;
    for (const Rigid3d& pose : poses)
      best = std::min(best, CentreError(pose, triple.cam_from_world));
    // Where two of the poses nearly coincide digits are lost.
    num_missed += !(best < 1e-5);
  }
  EXPECT_LE(num_missed, 2);
}

TEST(SolveP3P, EveryPoseHasThePointsOnTheRaysInFrontOfTheCamera) {
  Random random(4);
  size_t num_poses = 0;
  for (int trial = 0; trial < 5000; ++trial) {
    const Triple triple = MakeTriple(&random, 0.4);
    std::vector<Rigid3d> poses;
    SolveP3P(triple.rays, triple.points, &poses);
    num_poses += poses.size();
    for (const Rigid3d& pose : poses) {
      for (int k = 0; k < 3; ++k) {
        const Vector3d in_cam = pose * triple.points[k];
        EXPECT_GT(in_cam.dot(triple.rays[k]), 0.0);
        EXPECT_LT(in_cam.normalized().cross(triple.rays[k]).norm(), 1e-5);
      }
    }
  }
  EXPECT_GT(num_poses, 5000u);  // often there are two or more
}

// Fischler and Bolles, Random Sample Consensus, 1981.
TEST(SolveP3P, AnEquilateralTriangleSeenFromItsAxisHasFourPoses) {
  const double h = std::sqrt(3.0) / 2.0;
  const std::array<Vector3d, 3> points = {Vector3d(-1, -h / 1.5, 0), Vector3d(1, -h / 1.5, 0),
                                          Vector3d(0, 2 * h / 1.5, 0)};
  std::array<Vector3d, 3> rays;
  for (int k = 0; k < 3; ++k) rays[k] = (points[k] + Vector3d(0, 0, 3.0)).normalized();
  std::vector<Rigid3d> poses;
  SolveP3P(rays, points, &poses);
  EXPECT_EQ(poses.size(), 4u);
}

TEST(SolveP3P, PointsOnALineHaveNoPose) {
  const std::array<Vector3d, 3> points = {Vector3d(0, 0, 4), Vector3d(1, 0, 5), Vector3d(2, 0, 6)};
  std::array<Vector3d, 3> rays;
  for (int k = 0; k < 3; ++k) rays[k] = points[k].normalized();
  std::vector<Rigid3d> poses;
  SolveP3P(rays, points, &poses);
  EXPECT_TRUE(poses.empty());
}

}  // namespace
}  // namespace holba
