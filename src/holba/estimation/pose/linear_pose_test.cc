// SPDX-License-Identifier: BSD-3-Clause
#include "holba/estimation/pose/linear_pose.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "holba/base/random.h"
#include "holba/estimation/pose/pose_testing.h"
#include "holba/estimation/pose/quadrics.h"

namespace holba {
namespace {

using Eigen::Vector3d;

struct SeenScene {
  Rigid3d cam_from_world;
  std::vector<SeenPoint> points;
  std::vector<SeenLine> lines;
};

SeenScene MakeScene(size_t num_points, size_t num_lines, Random* random) {
  SeenScene scene;
  scene.cam_from_world = {ExpRotation(2.0 * RandomTestVector(random)).normalized(),
                          5.0 * RandomTestVector(random)};
  const Rigid3d world_from_cam = scene.cam_from_world.Inverse();
  const auto in_cam = [&]() -> Vector3d {
    return Vector3d(0.5 * random->Normal(), 0.5 * random->Normal(), 1.0) *
           random->Uniform(2.0, 8.0);
  };
  for (size_t k = 0; k < num_points; ++k) {
    const Vector3d x = in_cam();
    scene.points.push_back({x.normalized(), world_from_cam * x});
  }
  for (size_t k = 0; k < num_lines; ++k) {
    const Vector3d a = in_cam(), b = in_cam();
    scene.lines.push_back({a.cross(b).normalized(),
                           PlueckerLine::FromPoints(world_from_cam * a, world_from_cam * b)});
  }
  return scene;
}

Eigen::Quaterniond RandomTurn(Random* random) {
  return ExpRotation(2.0 * RandomTestVector(random)).normalized();
}

class EveryMix : public testing::TestWithParam<int> {};

TEST_P(EveryMix, OneOfThePosesIsTheTruthAndAllHaveTheFeaturesInTheirPlanes) {
  const size_t num_lines = static_cast<size_t>(GetParam());
  Random random(7);
  int num_missed = 0;
  size_t num_poses = 0;
  const int num_trials = 2000;
  for (int trial = 0; trial < num_trials; ++trial) {
    const SeenScene scene = MakeScene(3 - num_lines, num_lines, &random);
    std::vector<Rigid3d> poses;
    SolvePointsAndLines(scene.points, scene.lines, RandomTurn(&random), &poses);
    ASSERT_LE(poses.size(), 8u);
    num_poses += poses.size();
    double best = 1e9;
    for (const Rigid3d& pose : poses) {
      best = std::min(best, CentreError(pose, scene.cam_from_world));
      const double size = 1.0 + pose.OriginInA().norm();
      for (const SeenPoint& point : scene.points)
        EXPECT_LT((pose * point.X).cross(point.ray).norm(), 1e-5 * size);
      for (const SeenLine& line : scene.lines) {
        const PlueckerLine in_cam = Transform(pose, line.line);
        EXPECT_LT(in_cam.moment.cross(line.normal).norm(), 1e-5 * size);
      }
    }
    num_missed += !(best < 1e-5);
  }
  // Samples whose poses nearly coincide lose digits.
  EXPECT_LE(num_missed, num_trials / 200);
  EXPECT_GT(num_poses, static_cast<size_t>(num_trials));
}

INSTANTIATE_TEST_SUITE_P(Lines, EveryMix, testing::Values(1, 2, 3));

TEST(SolveTranslation, IsTheTruthForTheTrueRotation) {
  Random random(8);
  for (const auto& [num_points, num_lines] :
       {std::pair<size_t, size_t>{2, 0}, {1, 1}, {0, 3}, {3, 2}}) {
    for (int trial = 0; trial < 100; ++trial) {
      const SeenScene scene = MakeScene(num_points, num_lines, &random);
      const auto t = SolveTranslation(scene.cam_from_world.rotation, scene.points, scene.lines);
      ASSERT_TRUE(t);
      EXPECT_LT((*t - scene.cam_from_world.translation).norm(), 1e-6);
    }
  }
}

TEST(SolveTranslation, TooFewFeaturesOrParallelPlanesHaveNone) {
  Random random(9);
  const SeenScene scene = MakeScene(1, 1, &random);
  const Eigen::Quaterniond rotation = scene.cam_from_world.rotation;
  EXPECT_FALSE(SolveTranslation(rotation, scene.points, {}));
  EXPECT_FALSE(SolveTranslation(rotation, {}, scene.lines));
  const std::vector<SeenLine> one_three_times(3, scene.lines[0]);
  EXPECT_FALSE(SolveTranslation(rotation, {}, one_three_times));
}

TEST(SolveRotation, FourRotationsOfRightAnglesTwoOfOthersNoneOfWrongOnes) {
  Random random(10);
  for (int trial = 0; trial < 200; ++trial) {
    const Eigen::Quaterniond truth = RandomTurn(&random);
    const Vector3d a = RandomTestVector(&random).normalized();
    const Vector3d other = RandomTestVector(&random).normalized();
    const Vector3d across = a.cross(other).normalized();
    const auto best = [&](const std::vector<Eigen::Quaterniond>& rotations) {
      double error = 1e9;
      for (const Eigen::Quaterniond& r : rotations)
        error = std::min(error, LogRotation(r * truth.conjugate()).norm());
      return error;
    };
    std::vector<Eigen::Quaterniond> rotations;
    SolveRotation(truth * a, -(truth * across), a, across, 0.02, &rotations);
    EXPECT_EQ(rotations.size(), 4u);
    EXPECT_LT(best(rotations), 1e-7);
    const Vector3d slanted = (a + across).normalized();
    rotations.clear();
    SolveRotation(truth * a, -(truth * slanted), a, slanted, 0.02, &rotations);
    EXPECT_EQ(rotations.size(), 2u);
    EXPECT_LT(best(rotations), 1e-7);
    rotations.clear();
    SolveRotation(truth * a, truth * slanted, a, across, 0.02, &rotations);
    EXPECT_TRUE(rotations.empty());
    SolveRotation(truth * a, truth * a, a, across, 2.0, &rotations);
    EXPECT_TRUE(rotations.empty());
  }
}

// (x - 1)(x - 2) = (y - 1)(y - 3) = (z + 1)(z - 2) = 0 has the 8 corners of a box; mixtures of
// them, turned, have as many.
TEST(IntersectQuadrics, AllEightPointsAreFound) {
  Random random(11);
  for (int trial = 0; trial < 100; ++trial) {
    const Eigen::Matrix3d R = RandomTurn(&random).toRotationMatrix();
    const double lows[3] = {1, 1, -1}, highs[3] = {2, 3, 2};
    Quadric planes[3];
    for (int k = 0; k < 3; ++k) {
      const Vector3d n = R.row(k);
      planes[k] = {n.x() * n.x(),
                   n.y() * n.y(),
                   n.z() * n.z(),
                   2 * n.x() * n.y(),
                   2 * n.x() * n.z(),
                   2 * n.y() * n.z(),
                   -(lows[k] + highs[k]) * n.x(),
                   -(lows[k] + highs[k]) * n.y(),
                   -(lows[k] + highs[k]) * n.z(),
                   lows[k] * highs[k]};
    }
    std::array<Quadric, 3> mixed{};
    for (Quadric& q : mixed) {
      for (const Quadric& plane : planes) {
        const double weight = random.Normal();
        for (int c = 0; c < 10; ++c) q[c] += weight * plane[c];
      }
    }
    std::vector<Vector3d> points;
    IntersectQuadrics(mixed, &points);
    EXPECT_EQ(points.size(), 8u) << trial;
    for (const Vector3d& p : points) {
      const Vector3d corner = R * p;
      for (int k = 0; k < 3; ++k)
        EXPECT_LT(std::abs((corner[k] - lows[k]) * (corner[k] - highs[k])), 1e-6);
    }
  }
}

}  // namespace
}  // namespace holba
