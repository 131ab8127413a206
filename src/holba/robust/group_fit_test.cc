// SPDX-License-Identifier: BSD-3-Clause
#include "holba/robust/group_fit.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "holba/base/random.h"

namespace holba {
namespace {

// Distances from the surface.
GroupResiduals Distances(const GroupType& type, const std::vector<Eigen::Vector3d>& points) {
  return [&type, &points](const double* g, std::vector<double>* residuals) {
    for (size_t i = 0; i < points.size(); ++i) {
      Eigen::Vector3d on_group;
      (*residuals)[i] =
          type.project_point(g, points[i], &on_group) ? (points[i] - on_group).norm() : HUGE_VAL;
    }
  };
}

// Points on the sphere about (1, 2, 3) of radius 2, the last num_wrong anywhere near.
std::vector<Eigen::Vector3d> SpherePoints(size_t num, size_t num_wrong, Random* random) {
  std::vector<Eigen::Vector3d> points;
  for (size_t i = 0; i < num; ++i) {
    const double x = random->Normal(), y = random->Normal(), z = random->Normal();
    points.push_back(Eigen::Vector3d(1, 2, 3) + 2.0 * Eigen::Vector3d(x, y, z).normalized());
  }
  for (size_t i = 0; i < num_wrong; ++i) {
    for (double& x : points[num - 1 - i]) x += random->Uniform(-1.0, 1.0);
  }
  return points;
}

TEST(NumSamplesNeeded, IsTheNumberThatLeavesTheProbabilityOfNone) {
  // 1 - 0.5^n >= 0.999: n = log2(1000).
  EXPECT_NEAR(NumSamplesNeeded(0.999, 0.5, 1), std::log2(1000.0), 1e-12);
  for (const double share : {0.2, 0.5, 0.9}) {
    for (const size_t size : {1u, 3u, 8u}) {
      const double needed = NumSamplesNeeded(0.99, share, size);
      EXPECT_NEAR(std::pow(1.0 - std::pow(share, static_cast<double>(size)), needed), 0.01, 1e-12);
    }
  }
}

TEST(NumSamplesNeeded, GrowsWithoutLimitAsRightSamplesGetRare) {
  // 1 - 1e-27 is 1 in double precision.
  EXPECT_NEAR(NumSamplesNeeded(0.999, 1e-3, 9) / 6.907755e27, 1.0, 1e-6);
  EXPECT_EQ(NumSamplesNeeded(0.999, 0.0, 3), std::numeric_limits<double>::infinity());
  EXPECT_LT(NumSamplesNeeded(0.999, 1.0, 3), 1.0);
}

TEST(FitGroupRobustly, FindsTheSphereOfMostPoints) {
  const GroupType& sphere = *FindGroupType("SPHERE");
  Random random(1);
  const std::vector<Eigen::Vector3d> points = SpherePoints(60, 25, &random);
  const auto fit = FitGroupRobustly(sphere, points, {}, Distances(sphere, points), {.limit = 1e-3});
  ASSERT_TRUE(fit);
  const std::vector<double> plain = fit->FileParams(sphere);
  const double expected[] = {1.0, 2.0, 3.0, 2.0};
  for (int i = 0; i < 4; ++i) EXPECT_NEAR(plain[i], expected[i], 1e-9);
  EXPECT_EQ(fit->num_inliers, 35u);
  EXPECT_NEAR(fit->gain, 35.0, 1e-9);
  ASSERT_EQ(fit->residuals.size(), 60u);
  for (size_t i = 0; i < 60; ++i) EXPECT_EQ(fit->residuals[i] < 1e-3, i < 35) << i;
}

TEST(FitGroupRobustly, IsRepeatableAndTakesTheStartWithoutSamples) {
  const GroupType& sphere = *FindGroupType("SPHERE");
  Random random(2);
  const std::vector<Eigen::Vector3d> points = SpherePoints(40, 10, &random);
  const GroupResiduals distances = Distances(sphere, points);
  const auto a = FitGroupRobustly(sphere, points, {}, distances, {.limit = 0.01, .seed = 3});
  const auto b = FitGroupRobustly(sphere, points, {}, distances, {.limit = 0.01, .seed = 3});
  ASSERT_TRUE(a && b);
  EXPECT_EQ(a->g, b->g);
  const GroupRansacOptions no_samples{.limit = 0.01, .max_samples = 0};
  EXPECT_FALSE(FitGroupRobustly(sphere, points, {}, distances, no_samples));
  const auto from_start = FitGroupRobustly(sphere, points, {}, distances, no_samples, a->g.data());
  ASSERT_TRUE(from_start);
  EXPECT_EQ(from_start->num_inliers, a->num_inliers);
}

TEST(FitGroupRobustly, IsEmptyWithTooFewMembers) {
  const GroupType& sphere = *FindGroupType("SPHERE");
  const std::vector<Eigen::Vector3d> points{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  EXPECT_FALSE(FitGroupRobustly(sphere, points, {}, Distances(sphere, points), {}));
  const std::vector<Eigen::Vector3d> none;
  EXPECT_FALSE(FitGroupRobustly(sphere, none, {}, Distances(sphere, none), {}));
}

}  // namespace
}  // namespace holba
