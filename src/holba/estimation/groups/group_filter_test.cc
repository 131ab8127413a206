// SPDX-License-Identifier: BSD-3-Clause
#include "holba/estimation/groups/group_filter.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "holba/estimation/points/point_scene_testing.h"
#include "holba/synthetic/bundle_problem.h"

namespace holba {
namespace {

using testing::ElementsAre;
using testing::Pair;
using testing::UnorderedElementsAre;

TEST(TestMembers, DropsWhatIsBeyondThreeMedianDistances) {
  const GroupType& plane = *FindGroupType("PLANE");
  MemberOptions options;
  options.keep_px = 0.0;
  options.fit.max_error_px = 100.0;
  const MemberTest test = TestMembers(plane, {0.0, 0.5, 1.0, 1.5, 2.9, 3.0, 3.1}, options);
  EXPECT_EQ(test.limit, 4.5);
  EXPECT_EQ(test.num_inliers, 7);
  EXPECT_THAT(TestMembers(plane, {0.5, 1.0, 1.0, 3.0, 3.0001}, options).is_inlier,
              ElementsAre(true, true, true, true, false));
  // Never stricter than keep_px, never laxer than the bound in pixels.
  options.keep_px = 1.0;
  EXPECT_THAT(TestMembers(plane, {0.01, 0.02, 0.02, 0.9, 1.1}, options).is_inlier,
              ElementsAre(true, true, true, true, false));
  options.fit.max_error_px = 4.0;
  EXPECT_THAT(TestMembers(plane, {3.9, 3.9, 3.9, 4.1}, options).is_inlier,
              ElementsAre(true, true, true, false));
  EXPECT_EQ(TestMembers(plane, {}, options).num_inliers, 0);
}

TEST(FaultOfSupport, ASurfaceThatAnyFeaturesDetermineIsNotSupported) {
  const MemberOptions options;
  const GroupType &plane = *FindGroupType("PLANE"), &ellipsoid = *FindGroupType("ELLIPSOID");
  EXPECT_EQ(FaultOfSupport(plane, 3, 0, 6, options), nullptr);
  EXPECT_STREQ(FaultOfSupport(plane, 2, 0, 2, options), "few inliers");
  EXPECT_EQ(FaultOfSupport(plane, 1, 2, 3, options), nullptr);
  EXPECT_STREQ(FaultOfSupport(plane, 3, 0, 7, options), "small share of inliers");
  EXPECT_STREQ(FaultOfSupport(ellipsoid, 9, 0, 9, options), "few inliers");
  EXPECT_EQ(FaultOfSupport(ellipsoid, 10, 0, 12, options), nullptr);
}

// A plane z = 10 of 20 points, with `off` more, 0.5 before it.
Reconstruction PlaneWithStrays(int off) {
  Random random(1);
  Reconstruction model = MakeCameraRow(5, 1.0);
  Group3D group{.type = FindGroupType("PLANE"), .params = {0, 0, 1, -10.02}};
  for (int i = 0; i < 20 + off; ++i) {
    const double z = i < 20 ? 10.0 : 9.5 - 0.1 * (i - 20);
    group.point3D_ids.push_back(
        AddPoint({random.Uniform(-3, 3), random.Uniform(-3, 3), z}, 0.1, &random, &model));
  }
  model.groups3D.Add(7, group);
  return model;
}

TEST(UpdateMembers, RefitsAPlaneAndDropsStrays) {
  Reconstruction model = PlaneWithStrays(5);
  model.groups3D.at(7).point3D_ids.push_back(1000);  // no longer there
  const MemberReport report = UpdateMembers({}, &model);
  EXPECT_EQ(report.groups, 1);
  EXPECT_EQ(report.points, 20);
  EXPECT_THAT(report.dropped, UnorderedElementsAre(Pair("PLANE point: beyond the limit", 5),
                                                   Pair("PLANE point: not in the model", 1)));
  EXPECT_NEAR(model.groups3D.at(7).params[3] / model.groups3D.at(7).params[2], -10.0, 0.002);
  EXPECT_EQ(model.FindInconsistency(), std::nullopt);
  // Nothing more to drop.
  EXPECT_THAT(UpdateMembers({}, &model).dropped, testing::IsEmpty());
}

TEST(UpdateMembers, RemovesAGroupOfWrongMembersWithItsRelations) {
  Random random(2);
  Reconstruction model = PlaneWithStrays(0);
  Group3D wrong{.type = FindGroupType("PLANE"), .params = {0, 0, 1, -10.0}};
  for (int i = 0; i < 30; ++i) {
    wrong.point3D_ids.push_back(
        AddPoint({random.Uniform(-3, 3), random.Uniform(-3, 3), random.Uniform(6, 14)}, 0.1,
                 &random, &model));
  }
  wrong.observations = {{1, 0}};
  model.images.at(1).groups2D.push_back(
      {.type = FindGroupType("PLANE"), .group3D_id = 8, .point2D_idxs = {0}});
  model.groups3D.Add(8, wrong);
  model.relations.push_back({7, 8, RelationType::kParallel});
  ASSERT_EQ(model.FindInconsistency(), std::nullopt);
  const MemberReport report = UpdateMembers({}, &model);
  EXPECT_EQ(report.groups, 1);
  EXPECT_THAT(report.dropped, UnorderedElementsAre(Pair("PLANE group: small share of inliers", 1)));
  EXPECT_TRUE(model.groups3D.contains(7));
  EXPECT_FALSE(model.groups3D.contains(8));
  EXPECT_TRUE(model.relations.empty());
  EXPECT_EQ(model.images.at(1).groups2D[0].group3D_id, kNoId);
  EXPECT_EQ(model.FindInconsistency(), std::nullopt);
}

TEST(UpdateMembers, KeepsEveryTypeOfASyntheticSceneAndRepeatsForAnyNumberOfThreads) {
  BundleProblemOptions scene;
  scene.num_images = 20;
  scene.primitives = 1;
  scene.vps = true;
  scene.rotation_noise_deg = 0.0;
  scene.translation_noise = 0.0;
  scene.feature_noise = 0.01;  // about one pixel
  const Reconstruction model = MakeBundleProblem(scene).perturbed;
  Reconstruction one = model, four = model;
  MemberOptions options;
  options.num_threads = 1;
  const MemberReport report = UpdateMembers(options, &one);
  options.num_threads = 4;
  UpdateMembers(options, &four);
  EXPECT_EQ(report.groups, model.groups3D.size());
  size_t before = 0;
  for (const auto& [id, group] : model.groups3D) before += group.point3D_ids.size();
  EXPECT_GE(report.points, before * 9 / 10);
  ASSERT_EQ(one.groups3D.size(), four.groups3D.size());
  for (const auto& [id, group] : one.groups3D) {
    EXPECT_EQ(group.params, four.groups3D.at(id).params);
    EXPECT_EQ(group.point3D_ids, four.groups3D.at(id).point3D_ids);
    EXPECT_EQ(group.line3D_ids, four.groups3D.at(id).line3D_ids);
  }
  EXPECT_EQ(one.FindInconsistency(), std::nullopt);
}

}  // namespace
}  // namespace holba
