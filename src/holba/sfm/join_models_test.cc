// SPDX-License-Identifier: BSD-3-Clause
#include "holba/sfm/join_models.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "holba/sfm/mapper_testing.h"
#include "holba/sfm/refine_testing.h"

namespace holba {
namespace {

Sim3d SomeSimilarity() {
  Sim3d sim;
  sim.scale = 2.5;
  sim.rotation = Eigen::Quaterniond(0.6, 0.2, -0.5, 0.3).normalized();
  sim.translation = {4.0, -7.0, 1.5};
  return sim;
}

// The truth without some of its images.
Reconstruction Without(const Reconstruction& truth, std::initializer_list<image_t> images) {
  Reconstruction part = truth;
  for (const image_t id : images) part.DeregisterImage(id);
  return part;
}

TEST(AlignModels, FindsTheSimilarityInSpiteOfAWrongImage) {
  const Reconstruction truth = MakeRefineScene({.num_clutter = 0}).house.model;
  Reconstruction b = Without(truth, {1, 2});
  b.Transform(SomeSimilarity());
  Rigid3d wrong = b.images.at(5).cam_from_world;
  wrong.rotation =
      Eigen::Quaterniond(Eigen::AngleAxisd(2.0, Eigen::Vector3d::UnitX())) * wrong.rotation;
  b.SetFramePose(b.images.at(5).frame_id, wrong);
  const auto alignment = AlignModels(truth, b);
  ASSERT_TRUE(alignment);
  EXPECT_EQ(alignment->num_shared, 6u);
  EXPECT_EQ(alignment->num_agreeing, 5u);
  const Sim3d inverse = SomeSimilarity().Inverse();
  EXPECT_NEAR(alignment->a_from_b.scale, inverse.scale, 1e-9);
  EXPECT_LT((alignment->a_from_b.translation - inverse.translation).norm(), 1e-8);
}

TEST(AlignModels, NeedsThreeImagesAndMostOfThem) {
  const Reconstruction truth = MakeRefineScene({.num_clutter = 0}).house.model;
  EXPECT_FALSE(AlignModels(Without(truth, {1, 2, 3}), Without(truth, {6, 7, 8, 4})));
  Reconstruction half = truth;
  for (const image_t id : {1, 2, 3, 4}) {
    Rigid3d wrong = half.images.at(id).cam_from_world;
    wrong.translation += Eigen::Vector3d(0.0, 5.0 + id, 0.0);
    half.SetFramePose(half.images.at(id).frame_id, wrong);
  }
  EXPECT_FALSE(AlignModels(truth, half));
}

TEST(JoinModel, PutsMissingImagesWhereTheyBelong) {
  const Reconstruction truth = MakeRefineScene({.num_clutter = 0}).house.model;
  const MappingProblem problem = MakeMappingProblem(truth);
  MapperState state(problem.input, problem.scene);
  for (const image_t id : {1, 2, 3, 4, 5}) {
    state.RegisterFrame(state.model().unregistered_images.at(id).frame_id,
                        truth.images.at(id).cam_from_world);
  }
  Reconstruction other = Without(truth, {1, 2});
  other.Transform(SomeSimilarity());
  EXPECT_EQ(JoinModel(other, &state), std::optional<size_t>(3));
  EXPECT_EQ(JoinModel(other, &state), std::optional<size_t>(0));
  EXPECT_EQ(JoinModel(Without(truth, {1, 2, 3, 4, 5, 6}), &state), std::nullopt);
  ASSERT_EQ(state.model().images.size(), 8u);
  for (const image_t id : {6, 7, 8}) {
    const Rigid3d &ours = state.model().images.at(id).cam_from_world,
                  &theirs = truth.images.at(id).cam_from_world;
    EXPECT_LT((ours.OriginInA() - theirs.OriginInA()).norm(), 1e-8);
    EXPECT_LT(ours.rotation.angularDistance(theirs.rotation), 1e-8);
  }
}

}  // namespace
}  // namespace holba
