// SPDX-License-Identifier: BSD-3-Clause
#include "holba/geometry/rigid3d.h"

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cmath>
#include <numbers>

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
Rigid3d RandomRigid(Random* random) { return {RandomRotation(random), RandomVector(random, 5.0)}; }
Sim3d RandomSim(Random* random) {
  Sim3d sim;
  sim.scale = std::exp(random->Normal());
  sim.rotation = RandomRotation(random);
  sim.translation = RandomVector(random, 5.0);
  return sim;
}

TEST(Rigid3d, IsRotationThenTranslation) {
  // A quarter turn about z, then (1, 2, 3).
  const Rigid3d b_from_a(
      Eigen::Quaterniond(Eigen::AngleAxisd(std::numbers::pi / 2, Eigen::Vector3d::UnitZ())),
      {1, 2, 3});
  EXPECT_LT((b_from_a * Eigen::Vector3d(10, 0, 0) - Eigen::Vector3d(1, 12, 3)).norm(), 1e-14);
  EXPECT_LT((b_from_a.OriginInA() - Eigen::Vector3d(-2, 1, -3)).norm(), 1e-14);
  EXPECT_EQ(Rigid3d() * Eigen::Vector3d(4, 5, 6), Eigen::Vector3d(4, 5, 6));
}

TEST(Rigid3d, ProductIsComposition) {
  Random random(1);
  for (int trial = 0; trial < kTrials; ++trial) {
    const Rigid3d b_from_a = RandomRigid(&random), c_from_b = RandomRigid(&random);
    const Eigen::Vector3d x = RandomVector(&random);
    EXPECT_LT(((c_from_b * b_from_a) * x - c_from_b * (b_from_a * x)).norm(), 1e-13);
  }
}

TEST(Rigid3d, InverseUndoes) {
  Random random(2);
  for (int trial = 0; trial < kTrials; ++trial) {
    const Rigid3d b_from_a = RandomRigid(&random);
    const Eigen::Vector3d x = RandomVector(&random);
    EXPECT_LT((b_from_a.Inverse() * (b_from_a * x) - x).norm(), 1e-13);
    EXPECT_LT((b_from_a * b_from_a.OriginInA()).norm(), 1e-13);
    EXPECT_LT((b_from_a.Inverse() * Eigen::Vector3d::Zero() - b_from_a.OriginInA()).norm(), 1e-13);
  }
}

TEST(Rigid3d, LengthOfTheQuaternionDoesNotMatter) {
  Random random(3);
  for (int trial = 0; trial < kTrials; ++trial) {
    const Rigid3d pose = RandomRigid(&random);
    Rigid3d scaled = pose;
    scaled.rotation.coeffs() *= 1.7;
    const Eigen::Vector3d x = RandomVector(&random);
    EXPECT_LT((scaled * x - pose * x).norm(), 1e-13);
    EXPECT_LT((scaled.RotationMatrix() - pose.RotationMatrix()).norm(), 1e-14);
    EXPECT_LT((scaled.Inverse() * x - pose.Inverse() * x).norm(), 1e-13);
    EXPECT_LT(((scaled * scaled) * x - (pose * pose) * x).norm(), 1e-13);
    EXPECT_LT((scaled.OriginInA() - pose.OriginInA()).norm(), 1e-13);
    EXPECT_LT((scaled.RotationMatrix() * x + scaled.translation - scaled * x).norm(), 1e-13);
  }
}

TEST(Sim3d, ScalesRotatesAndMoves) {
  Sim3d b_from_a;
  b_from_a.scale = 2;
  b_from_a.rotation = Eigen::AngleAxisd(std::numbers::pi / 2, Eigen::Vector3d::UnitZ());
  b_from_a.translation = {1, 2, 3};
  EXPECT_LT((b_from_a * Eigen::Vector3d(10, 0, 4) - Eigen::Vector3d(1, 22, 11)).norm(), 1e-14);
}

TEST(Sim3d, InverseUndoes) {
  Random random(4);
  for (int trial = 0; trial < kTrials; ++trial) {
    const Sim3d b_from_a = RandomSim(&random);
    const Eigen::Vector3d x = RandomVector(&random);
    EXPECT_LT((b_from_a.Inverse() * (b_from_a * x) - x).norm(), 1e-11);
    EXPECT_LT((b_from_a * (b_from_a.Inverse() * x) - x).norm(), 1e-11);
  }
}

TEST(Sim3d, TransformedPosesKeepProjections) {
  Random random(5);
  for (int trial = 0; trial < kTrials; ++trial) {
    const Sim3d new_from_old = RandomSim(&random);
    const Rigid3d cam_from_old = RandomRigid(&random);
    const Rigid3d cam_from_new = new_from_old.TransformPose(cam_from_old);
    const Eigen::Vector3d x = RandomVector(&random);
    const Eigen::Vector3d before = cam_from_old * x, after = cam_from_new * (new_from_old * x);
    // The same ray, longer by the scale: the same pixel.
    EXPECT_LT((after - new_from_old.scale * before).norm(), 1e-12 * after.norm());
    EXPECT_LT((cam_from_new.OriginInA() - new_from_old * cam_from_old.OriginInA()).norm(), 1e-11);
  }
}

TEST(Rotation, ExponentialIsTheAngleAxisRotation) {
  Random random(6);
  for (const double angle : {1e-12, 1e-9, 1e-7, 1e-3, 0.5, 3.0, 5.0}) {
    const Eigen::Vector3d axis = RandomVector(&random).normalized();
    const Eigen::Matrix3d expected = Eigen::AngleAxisd(angle, axis).toRotationMatrix();
    EXPECT_LT((ExpRotation(angle * axis).toRotationMatrix() - expected).norm(),
              1e-15 + 1e-14 * angle)
        << angle;
  }
  EXPECT_TRUE(ExpRotation(Eigen::Vector3d::Zero()).isApprox(Eigen::Quaterniond::Identity()));
}

TEST(Rotation, LogarithmInvertsTheExponential) {
  Random random(7);
  for (const double angle : {0.0, 1e-13, 1e-12, 1e-9, 1e-7, 1e-3, 0.5, 2.0, 3.0, 3.141592}) {
    const Eigen::Vector3d w = angle * RandomVector(&random).normalized();
    EXPECT_LT((LogRotation(ExpRotation(w)) - w).norm(), 1e-9 * angle + 1e-15) << angle;
  }
}

TEST(Rotation, LogarithmIsTheShortWay) {
  // 5 rad one way are 2 pi - 5 the other way.
  const Eigen::Vector3d axis = Eigen::Vector3d(1, 2, -1).normalized();
  const Eigen::Vector3d w = LogRotation(ExpRotation(5.0 * axis));
  EXPECT_LT((w + (2 * std::numbers::pi - 5.0) * axis).norm(), 1e-14);
  Eigen::Quaterniond q = ExpRotation(0.4 * axis);
  q.coeffs() *= -3.0;
  EXPECT_LT((LogRotation(q) - 0.4 * axis).norm(), 1e-14);
}

}  // namespace
}  // namespace holba
