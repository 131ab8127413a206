// SPDX-License-Identifier: BSD-3-Clause
#include "holba/synthetic/group_start.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "holba/synthetic/synthetic_structure.h"

namespace holba {
namespace {

// Points of one primitive about the origin with noise, a part of them anywhere.
struct Sample {
  std::vector<Eigen::Vector3d> exact, noisy;
};
Sample MakeSample(const GroupType& type, double noise, double fraction_wrong, Random* random) {
  SyntheticStructure structure;
  AddPrimitive(type, {Eigen::Vector3d::Zero(), Eigen::Vector3d::Constant(3.0)}, random, &structure);
  Sample sample;
  sample.exact = structure.points;
  for (size_t i = 0; i < sample.exact.size(); ++i) {
    Eigen::Vector3d X = sample.exact[i];
    for (double& x : X) x += random->Normal(noise);
    if (static_cast<double>(i) < fraction_wrong * static_cast<double>(sample.exact.size())) {
      for (double& x : X) x = random->Uniform(-3.0, 3.0);
    }
    sample.noisy.push_back(X);
  }
  return sample;
}

// Root mean square distance of points from the fitted surface.
double Rms(const GroupType& type, const std::vector<double>& plain,
           const std::vector<Eigen::Vector3d>& points) {
  std::array<double, kMaxGroupParams> g{};
  EXPECT_TRUE(type.from_file(plain.data(), g.data()));
  double squares = 0;
  for (const Eigen::Vector3d& X : points) {
    Eigen::Vector3d projected;
    EXPECT_TRUE(type.project_point(g.data(), X, &projected));
    squares += (projected - X).squaredNorm();
  }
  return std::sqrt(squares / static_cast<double>(points.size()));
}

TEST(GroupStart, FindsEveryPrimitiveExactlyFromExactPoints) {
  for (const GroupType* type : PrimitiveTypes()) {
    for (uint64_t seed = 0; seed < 5; ++seed) {
      Random random(seed);
      const Sample sample = MakeSample(*type, 0.0, 0.0, &random);
      const auto fit = GroupStart(*type, sample.noisy, {}, 1e-6, &random);
      ASSERT_TRUE(fit) << type->name;
      EXPECT_LT(Rms(*type, *fit, sample.exact), 1e-7) << type->name;
    }
  }
}

TEST(GroupStart, IsNearerToTheTruthThanTheNoisyPointsDespiteWrongOnes) {
  constexpr double kNoise = 0.02;
  for (const GroupType* type : PrimitiveTypes()) {
    // A minimal sample of 9 points hardly ever is without a wrong one.
    const double fraction_wrong = type->min_points <= 5 ? 0.3 : 0.1;
    std::vector<double> errors;
    for (uint64_t seed = 0; seed < 7; ++seed) {
      Random random(seed);
      const Sample sample = MakeSample(*type, kNoise, fraction_wrong, &random);
      const auto fit = GroupStart(*type, sample.noisy, {}, 3.0 * kNoise, &random);
      ASSERT_TRUE(fit) << type->name;
      errors.push_back(Rms(*type, *fit, sample.exact));
    }
    std::sort(errors.begin(), errors.end());
    EXPECT_LT(errors[3], kNoise) << type->name;
  }
}

TEST(GroupStart, TakesTheDirectionOfMostLines) {
  const GroupType* type = FindGroupType("VP");
  Random random(1);
  const Eigen::Vector3d v = Eigen::Vector3d(1, 2, -2).normalized();
  std::vector<PlueckerLine> lines;
  for (int i = 0; i < 50; ++i) {
    Eigen::Vector3d d = i % 2 == 0 ? v : -v, p;
    if (i % 5 < 2) d.setZero();
    for (double& x : d) x += random.Normal(i % 5 < 2 ? 1.0 : 0.03);
    for (double& x : p) x = random.Normal();
    lines.push_back(PlueckerLine::FromPointDirection(p, d));
  }
  const auto fit = GroupStart(*type, {}, lines, 0.2, &random);
  ASSERT_TRUE(fit);
  EXPECT_LT(Eigen::Vector3d(fit->data()).cross(v).norm(), 0.03);
}

TEST(GroupStart, FailsWithTooFewFeatures) {
  Random random(1);
  const std::vector<Eigen::Vector3d> two(2, Eigen::Vector3d::Zero());
  EXPECT_FALSE(GroupStart(*FindGroupType("PLANE"), two, {}, 0.1, &random));
  EXPECT_FALSE(GroupStart(*FindGroupType("VP"), {}, {}, 0.1, &random));
}

}  // namespace
}  // namespace holba
