// SPDX-License-Identifier: BSD-3-Clause
#include "holba/estimation/groups/group_forming.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "holba/estimation/groups/group_estimation.h"
#include "holba/estimation/points/point_scene_testing.h"
#include "holba/synthetic/bundle_problem.h"

namespace holba {
namespace {

using testing::ElementsAre;
using testing::Pair;
using testing::UnorderedElementsAre;

// A scene with planes and one of each primitive, whose regions have lost their groups. `perturbed`
// has a pixel of noise in 3D.
struct LabelledScene {
  Reconstruction truth, model;
};
LabelledScene MakeScene(uint64_t seed, double fraction_wrong) {
  BundleProblemOptions options;
  options.seed = seed;
  options.num_images = 20;
  options.primitives = 1;
  options.rotation_noise_deg = 0.0;
  options.translation_noise = 0.0;
  options.feature_noise = 0.01;
  options.fraction_wrong_associations = fraction_wrong;
  SyntheticProblem problem = MakeBundleProblem(options);
  LabelledScene scene{std::move(problem.truth), std::move(problem.perturbed)};
  scene.model.groups3D = {};
  scene.model.relations.clear();
  for (auto& [image_id, image] : scene.model.images) {
    for (Group2D& group : image.groups2D) group.group3D_id = kNoId;
  }
  return scene;
}

// The formed group of the type that has most of a true one's members.
const Group3D* Counterpart(const Reconstruction& model, const Group3D& truth) {
  const std::set<point3D_t> members(truth.point3D_ids.begin(), truth.point3D_ids.end());
  for (const auto& [id, group] : model.groups3D) {
    const auto common = std::count_if(group.point3D_ids.begin(), group.point3D_ids.end(),
                                      [&](point3D_t p) { return members.contains(p); });
    if (group.type == truth.type && 2 * common > static_cast<long>(group.point3D_ids.size())) {
      return &group;
    }
  }
  return nullptr;
}

class AllTypes : public testing::TestWithParam<double> {};

TEST_P(AllTypes, AreFormedFromLabelledRegions) {
  for (const uint64_t seed : {0, 1}) {
    LabelledScene scene = MakeScene(seed, GetParam());
    const GroupFormingReport report = FormGroups({}, {}, {}, &scene.model);
    ASSERT_EQ(scene.model.FindInconsistency(), std::nullopt);
    EXPECT_EQ(scene.model.groups3D.size(), scene.truth.groups3D.size());
    EXPECT_GE(report.joined, report.observations * 9 / 10);
    FeatureLookup lookup(scene.truth);
    for (const auto& [id, truth] : scene.truth.groups3D) {
      const Group3D* formed = Counterpart(scene.model, truth);
      ASSERT_NE(formed, nullptr) << truth.type->name << ", seed " << seed;
      // Against the true points, which the formed group has never seen.
      double g[kMaxGroupParams];
      ASSERT_TRUE(formed->type->from_file(formed->params.data(), g));
      std::vector<double> residuals =
          EvaluateGroup(*truth.type, g, lookup.Find(*truth.type, truth.point3D_ids, {}), 4.0)
              .residuals;
      std::sort(residuals.begin(), residuals.end());
      // The faces of a cuboid are unbounded planes: a wrong point beside it may hold one away from
      // where only few points are.
      const bool is_loose = truth.type->name == "CUBOID" && GetParam() > 0.0;
      EXPECT_LT(residuals[residuals.size() / 2], is_loose ? 1.0 : 0.6)
          << truth.type->name << ", seed " << seed;
      if (!is_loose) {
        EXPECT_LT(residuals[residuals.size() * 9 / 10], 2.5) << truth.type->name;
      }
      // Its members are right ones.
      const std::set<point3D_t> right(truth.point3D_ids.begin(), truth.point3D_ids.end());
      const auto wrong = std::count_if(formed->point3D_ids.begin(), formed->point3D_ids.end(),
                                       [&](point3D_t p) { return !right.contains(p); });
      EXPECT_LE(wrong, is_loose ? 4 : 2) << truth.type->name << ", seed " << seed;
      EXPECT_GE(formed->point3D_ids.size(), right.size() * 7 / 10) << truth.type->name;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(WithWrongLabels, AllTypes, testing::Values(0.0, 0.2));

TEST(FormGroups, RepeatsBitForBit) {
  LabelledScene a = MakeScene(3, 0.2);
  for (auto& [image_id, image] : a.model.images) {
    std::erase_if(image.groups2D, [](const Group2D& g) {  // slow to fit
      return g.type->name == "CONE" || g.type->name == "CUBOID";
    });
  }
  LabelledScene b = a;
  FormGroups({}, {}, {}, &a.model);
  FormGroups({}, {}, {}, &b.model);
  ASSERT_EQ(a.model.groups3D.size(), b.model.groups3D.size());
  for (const auto& [id, group] : a.model.groups3D) {
    EXPECT_EQ(group.params, b.model.groups3D.at(id).params);
    EXPECT_EQ(group.point3D_ids, b.model.groups3D.at(id).point3D_ids);
  }
}

// A wall z = 10 of 40 points seen by 4 images; regions(i, k): whether point k is in image i's
// region, of which there is one for each image.
struct Wall {
  Reconstruction model;
  std::vector<point3D_t> points;
};
Wall MakeWall() {
  Random random(5);
  Wall wall{MakeCameraRow(4, 1.0), {}};
  for (int i = 0; i < 40; ++i) {
    wall.points.push_back(
        AddPoint({random.Uniform(-3, 3), random.Uniform(-3, 3), 10.0}, 0.2, &random, &wall.model));
  }
  return wall;
}
// Points [first, last) in a region of one image. All images have the points in the same order.
void AddRegion(image_t image_id, point2D_t first, point2D_t last, Reconstruction* model) {
  Group2D region{.type = FindGroupType("PLANE")};
  for (point2D_t k = first; k < last; ++k) region.point2D_idxs.push_back(k);
  model->images.at(image_id).groups2D.push_back(region);
}

TEST(FormGroups, ThreeCommonFeaturesMakeAGroupAndTwoDoNot) {
  for (const point2D_t common : {2u, 3u}) {
    Wall wall = MakeWall();
    AddRegion(1, 0, 10, &wall.model);
    AddRegion(2, 10 - common, 20, &wall.model);
    const GroupFormingReport report = FormGroups({}, {}, {}, &wall.model);
    EXPECT_EQ(report.formed, common == 3 ? 1 : 0);
    EXPECT_EQ(report.joined, common == 3 ? 2 : 0);
    EXPECT_EQ(wall.model.FindInconsistency(), std::nullopt);
    EXPECT_EQ(report.dropped.contains("PLANE region: no group"), common == 2);
  }
}

TEST(FormGroups, ARegionJoinsAKnownGroupByTwoFeaturesAndBringsOthers) {
  Wall wall = MakeWall();
  wall.model.groups3D.Add(3, {.type = FindGroupType("PLANE"),
                              .params = {0, 0, 1, -10},
                              .point3D_ids = {wall.points[0], wall.points[1]}});
  AddRegion(1, 0, 10, &wall.model);
  AddRegion(2, 1, 10, &wall.model);  // has one of the two, and then many of those that came
  const GroupFormingReport report = FormGroups({}, {}, {}, &wall.model);
  EXPECT_EQ(report.formed, 0);
  EXPECT_EQ(report.joined, 2);
  EXPECT_EQ(wall.model.groups3D.at(3).point3D_ids.size(), 10);
  EXPECT_EQ(wall.model.groups3D.at(3).observations.size(), 2);
  EXPECT_EQ(wall.model.FindInconsistency(), std::nullopt);
}

TEST(FormGroups, MatchedRegionsNeedNoCommonFeatures) {
  Wall wall = MakeWall();
  AddRegion(1, 0, 8, &wall.model);
  AddRegion(2, 20, 28, &wall.model);
  const std::vector<GroupObservationPair> matches = {{{1, 0}, {2, 0}}};
  Reconstruction without = wall.model;
  EXPECT_EQ(FormGroups({}, {}, {}, &without).formed, 0);
  // Each image sees the other's points outside of its region: half of the votes.
  EXPECT_EQ(FormGroups({}, matches, {}, &wall.model).formed, 1);
  EXPECT_EQ(wall.model.groups3D.begin()->second.point3D_ids.size(), 16);
  const std::vector<GroupObservationPair> unknown = {{{1, 0}, {2, 5}}};
  EXPECT_EQ(FormGroups({}, unknown, {}, &without).dropped.at("match: unknown region"), 1);
}

TEST(FormGroups, GroupsThatOnePlaneExplainsAreMergedAndOthersNot) {
  for (const double depth : {10.0, 10.2}) {
    Wall wall = MakeWall();
    Random random(6);
    for (int i = 0; i < 20; ++i) {
      AddPoint({random.Uniform(-3, 3), random.Uniform(-3, 3), depth}, 0.2, &random, &wall.model);
    }
    // Two regions in image 1 and two in image 2: two groups at first. Image 3 sees all in one.
    AddRegion(1, 0, 40, &wall.model);
    AddRegion(1, 40, 60, &wall.model);
    AddRegion(2, 0, 40, &wall.model);
    AddRegion(2, 40, 60, &wall.model);
    const std::vector<GroupObservationPair> matches = {{{1, 0}, {2, 1}}};
    const GroupFormingReport report = FormGroups({}, matches, {}, &wall.model);
    EXPECT_EQ(report.formed, 2);
    EXPECT_EQ(report.merged, depth == 10.0 ? 1 : 0);
    EXPECT_EQ(wall.model.groups3D.size(), depth == 10.0 ? 1 : 2);
    EXPECT_EQ(wall.model.FindInconsistency(), std::nullopt);
  }
}

TEST(FormGroups, AnObservedNormalThirtyDegreesOffForbidsThePlane) {
  for (const double angle : {25.0, 35.0}) {
    Wall wall = MakeWall();
    for (const image_t image_id : {1, 2, 3}) AddRegion(image_id, 0, 20, &wall.model);
    const double rad = angle * 0.017453292519943295;
    GroupNormals normals;
    for (const image_t image_id : {1, 2}) {
      normals[{image_id, 0}] = {Eigen::Vector3d(std::sin(rad), 0, -std::cos(rad)), 5.0};
    }
    const GroupFormingReport report = FormGroups({}, {}, normals, &wall.model);
    EXPECT_EQ(report.formed, angle == 25.0 ? 1 : 0);
    if (angle == 35.0) {
      EXPECT_EQ(report.dropped.at("PLANE group: contradicts its normals"), 1);
    }
  }
}

}  // namespace
}  // namespace holba
