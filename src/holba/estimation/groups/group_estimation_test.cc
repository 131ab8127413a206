// SPDX-License-Identifier: BSD-3-Clause
#include "holba/estimation/groups/group_estimation.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "holba/base/random.h"

namespace holba {
namespace {

// Points of a unit sphere's upper half about (1, 2, 3), every fifth one replaced by a random one.
GroupFeatures SphereWithOutliers(Random* random) {
  GroupFeatures features;
  for (uint64_t i = 0; i < 50; ++i) {
    Eigen::Vector3d u(random->Normal(), random->Normal(), std::abs(random->Normal()));
    if (i % 5 == 0) {
      u *= 1.5;
    } else {
      u = u.normalized() * (1.0 + random->Normal(0.002));
    }
    features.point_ids.push_back(i);
    features.points.push_back({Eigen::Vector3d(1, 2, 3) + u, 0.002});
  }
  return features;
}

MeasuredLine LineBetween(const Eigen::Vector3d& a, const Eigen::Vector3d& b, double length_per_px) {
  return {PlueckerLine::FromPoints(a, b), a, b, length_per_px};
}

TEST(FitGroup, FindsASphereAmongWrongPointsToItsNoise) {
  Random random(1);
  const GroupFeatures features = SphereWithOutliers(&random);
  const auto fit = FitGroup(*FindGroupType("SPHERE"), features, {});
  ASSERT_TRUE(fit);
  EXPECT_THAT(fit->num_inliers, testing::AllOf(testing::Ge(40), testing::Le(43)));
  const std::vector<double> params = fit->FileParams(*FindGroupType("SPHERE"));
  // 0.002 of noise over 40 points, and half of the sphere only.
  EXPECT_NEAR(params[0], 1.0, 0.002);
  EXPECT_NEAR(params[1], 2.0, 0.002);
  EXPECT_NEAR(params[2], 3.0, 0.004);
  EXPECT_NEAR(params[3], 1.0, 0.004);
}

TEST(FitGroup, ResidualsAreDistancesInPixels) {
  const GroupType& plane = *FindGroupType("PLANE");
  const double g[] = {0, 0, 1, -2};
  EXPECT_NEAR(GroupResidual(plane, g, MeasuredPoint{{5, 6, 2.5}, 0.25}), 2.0, 1e-12);
  // The farther end decides.
  EXPECT_NEAR(GroupResidual(plane, g, LineBetween({0, 0, 2.1}, {1, 0, 1.7}, 0.1)), 3.0, 1e-12);
  const GroupType& vp = *FindGroupType("VP");
  const double v[] = {1, 0, 0};
  EXPECT_NEAR(GroupResidual(vp, v, LineBetween({1, 1, 0}, {0, 0, 0}, 0.1)), 45.0, 1e-9);
}

TEST(FitGroup, PlanesComeFromLinesAloneAndFromBoth) {
  GroupFeatures lines;
  for (int i = 0; i < 4; ++i) {
    const double x = i;
    lines.lines.push_back(LineBetween({x, 0, 3}, {x + 0.3 * i, 2, 3}, 0.01));
  }
  lines.lines.push_back(LineBetween({0, 0, 4}, {1, 2, 6}, 0.01));
  GroupFeatures both = lines;
  both.points = {{{0, 0, 3}, 0.01}, {{2, 1, 3}, 0.01}, {{1, 1, 3}, 0.01}, {{1, 0, 5}, 0.01}};
  const GroupType& plane = *FindGroupType("PLANE");
  for (const GroupFeatures* features : {&lines, &both}) {
    const auto fit = FitGroup(plane, *features, {});
    ASSERT_TRUE(fit);
    EXPECT_EQ(fit->num_inliers, features->size() - (features == &both ? 2 : 1));
    EXPECT_NEAR(std::abs(fit->g[2]), 1.0, 1e-9);
    EXPECT_NEAR(std::abs(fit->g[3]), 3.0, 1e-9);
  }
}

TEST(FitGroup, TooFewFeaturesGiveNothing) {
  GroupFeatures features;
  features.points = {{{0, 0, 0}, 1.0}, {{1, 0, 0}, 1.0}};
  EXPECT_FALSE(FitGroup(*FindGroupType("PLANE"), features, {}));
  EXPECT_FALSE(FitGroup(*FindGroupType("SPHERE"), features, {}));
  EXPECT_FALSE(FitGroup(*FindGroupType("VP"), GroupFeatures{}, {}));
}

TEST(FitGroup, RepeatsForOneSeedAndTakesAGoodStart) {
  Random random(2);
  const GroupFeatures features = SphereWithOutliers(&random);
  const GroupType& sphere = *FindGroupType("SPHERE");
  const auto a = FitGroup(sphere, features, {}), b = FitGroup(sphere, features, {});
  ASSERT_TRUE(a && b);
  EXPECT_EQ(a->g, b->g);
  GroupFitOptions no_samples;
  no_samples.max_samples = 0;
  EXPECT_FALSE(FitGroup(sphere, features, no_samples));
  const auto from_start = FitGroup(sphere, features, no_samples, a->g.data());
  ASSERT_TRUE(from_start);
  EXPECT_GE(from_start->gain, a->gain);
}

}  // namespace
}  // namespace holba
