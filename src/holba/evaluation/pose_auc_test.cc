// SPDX-License-Identifier: BSD-3-Clause
#include "holba/evaluation/pose_auc.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "holba/evaluation/test_scenes.h"
#include "holba/geometry/angle.h"

namespace holba {
namespace {

using ::testing::DoubleNear;
using ::testing::Each;
using ::testing::Lt;

const double kInfinity = std::numeric_limits<double>::infinity();

TEST(PoseAuc, IsTheMeanOfOneMinusErrorOverThreshold) {
  // 1 - 0.5/2 = 0.75, 1 - 1/2 = 0.5, 0 at the threshold and beyond.
  const std::vector<double> errors{0.5, 1.0, 2.0, 3.0, kInfinity};
  EXPECT_DOUBLE_EQ(PoseAuc(errors, 2.0), (0.75 + 0.5) / 5);
  EXPECT_DOUBLE_EQ(PoseAuc(errors, 0.25), 0.0);
  EXPECT_DOUBLE_EQ(PoseAuc({}, 2.0), 0.0);
  EXPECT_DOUBLE_EQ(PoseAuc(std::vector<double>{0.0, 0.0}, 1.0), 1.0);
}

TEST(PoseAuc, OfTheTrapezoidConventionJoinsTheSteps) {
  // Through (0, 0), (0.5, 1/4), (1, 2/4), then level to 2: 0.0625 + 0.1875 + 0.5 over 2.
  const std::vector<double> errors{1.0, 0.5, 3.0, kInfinity};
  EXPECT_DOUBLE_EQ(PoseAuc(errors, 2.0, AucConvention::kTrapezoid), 0.75 / 2);
  EXPECT_DOUBLE_EQ(PoseAuc({}, 2.0, AucConvention::kTrapezoid), 0.0);
  // Nothing below the threshold.
  EXPECT_DOUBLE_EQ(PoseAuc(errors, 0.5, AucConvention::kTrapezoid), 0.0);
}

TEST(PoseAuc, OfBothConventionsAgreesForManyPairs) {
  Random random(3);
  std::vector<double> errors(200000);
  for (double& e : errors) e = std::abs(random.Normal(3.0));
  for (const double threshold : {1.0, 3.0, 5.0, 10.0}) {
    EXPECT_NEAR(PoseAuc(errors, threshold), PoseAuc(errors, threshold, AucConvention::kTrapezoid),
                1e-4);
  }
}

TEST(ComparePoses, IsFreeOfTheGauge) {
  Random random(5);
  const Reconstruction truth = RandomCameras(12, &random);
  const PoseErrors errors = ComparePoses(Moved(truth, RandomSimilarity(&random)), truth);
  EXPECT_EQ(errors.images, 12);
  EXPECT_EQ(errors.registered, 12);
  EXPECT_EQ(errors.registered_pairs, 66);
  ASSERT_EQ(errors.pair_deg.size(), 66);
  EXPECT_THAT(errors.pair_deg, Each(Lt(1e-6)));
}

TEST(ComparePoses, LosesAllPairsOfAMissingImageAndNoOthers) {
  Random random(6);
  const Reconstruction truth = RandomCameras(12, &random);
  Reconstruction model = truth;
  model.images.RemoveIf([](image_t id, const Image&) { return id == 4; });
  const PoseErrors errors = ComparePoses(model, truth);
  EXPECT_EQ(errors.registered, 11);
  EXPECT_EQ(errors.registered_pairs, 55);
  EXPECT_EQ(std::count(errors.pair_deg.begin(), errors.pair_deg.end(), kInfinity), 11);
  EXPECT_NEAR(PoseAuc(errors.pair_deg, 5.0), 55.0 / 66.0, 1e-7);
}

TEST(ComparePoses, MeasuresATurnedCameraInItsOwnPairs) {
  Random random(7);
  const Reconstruction truth = RandomCameras(12, &random);
  Reconstruction model = Moved(truth, RandomSimilarity(&random));
  const Rigid3d turn(ExpRotation(2.0 * kRadPerDeg * Eigen::Vector3d(1, 2, -1).normalized()),
                     Eigen::Vector3d::Zero());
  model.images.at(6).cam_from_world = turn * model.images.at(6).cam_from_world;
  const PoseErrors errors = ComparePoses(model, truth);
  EXPECT_EQ(std::count_if(errors.rotation_deg.begin(), errors.rotation_deg.end(),
                          [](double e) { return std::abs(e - 2.0) < 1e-6; }),
            11);
  EXPECT_THAT(errors.translation_deg, Each(Lt(2.0 + 1e-6)));
  // 55 pairs without error, 11 with 2 degrees.
  EXPECT_NEAR(PoseAuc(errors.pair_deg, 5.0), (55 + 11 * (1 - 2.0 / 5.0)) / 66, 1e-6);
  EXPECT_NEAR(PoseAuc(errors.pair_deg, 1.0), 55.0 / 66.0, 1e-6);
}

TEST(ComparePoses, MeasuresTheDirectionOfTheTranslation) {
  Reconstruction truth, model;
  const Eigen::Quaterniond same = Eigen::Quaterniond::Identity();
  AddImage("a", LookingFrom({0, 0, 0}, same), &truth);
  AddImage("b", LookingFrom({1, 0, 0}, same), &truth);
  AddImage("a", LookingFrom({0, 0, 0}, same), &model);
  AddImage("b", LookingFrom({-2, -2, 0}, same), &model);
  EXPECT_THAT(ComparePoses(model, truth).pair_deg, Each(DoubleNear(135.0, 1e-9)));
  EXPECT_THAT(ComparePoses(model, truth, {.fold_translation = true}).pair_deg,
              Each(DoubleNear(45.0, 1e-9)));
  // A model that puts both in one place has no direction.
  model.images.at(2).cam_from_world = model.images.at(1).cam_from_world;
  EXPECT_THAT(ComparePoses(model, truth).pair_deg, Each(DoubleNear(180.0, 1e-9)));
}

TEST(ComparePoses, IgnoresTheDirectionOfBaselinesThatAreShortToTheMedian) {
  Reconstruction truth, model;
  const Eigen::Quaterniond same = Eigen::Quaterniond::Identity();
  // True baselines 1e-4, 1, 1.
  for (const double x : {0.0, 1e-4, 1.0}) {
    AddImage(std::to_string(truth.images.size()), LookingFrom({x, 0, 0}, same), &truth);
  }
  for (const Eigen::Vector3d& centre :
       {Eigen::Vector3d(0, 0, 0), Eigen::Vector3d(0, 1e-4, 0), Eigen::Vector3d(1, 0, 0)}) {
    AddImage(std::to_string(model.images.size()), LookingFrom(centre, same), &model);
  }
  EXPECT_EQ(ComparePoses(model, truth).translation_deg[0], 0.0);
  EXPECT_NEAR(ComparePoses(model, truth, {.min_baseline = 0.0}).translation_deg[0], 90.0, 1e-9);
}

TEST(ComparePoses, PairsByWholeNameFirstAndThenByAUniqueLastComponent) {
  Random random(8);
  const Reconstruction poses = RandomCameras(6, &random);
  const auto named = [&](const std::vector<std::string>& names) {
    Reconstruction model;
    for (size_t i = 0; i < names.size(); ++i) {
      AddImage(names[i], poses.images.at(static_cast<image_t>(i + 1)).cam_from_world, &model);
    }
    return model;
  };
  // b is only found by its last component; c is ambiguous; a has its whole name besides x/a.
  const Reconstruction truth = named({"a", "gt/b", "c"});
  Reconstruction model = named({"a", "model/b", "x/c", "y/c", "x/a"});
  const PoseErrors errors = ComparePoses(model, truth);
  EXPECT_EQ(errors.registered, 2);
  EXPECT_EQ(errors.registered_pairs, 1);
  // Pairs (a, c), (a, gt/b), (c, gt/b) in order of names.
  EXPECT_EQ(errors.pair_deg[0], kInfinity);
  EXPECT_LT(errors.pair_deg[1], 1e-6);
  EXPECT_EQ(errors.pair_deg[2], kInfinity);
}

TEST(ComparePoses, HasNoPairsOfLessThanTwoImages) {
  Random random(9);
  const Reconstruction one = RandomCameras(1, &random);
  EXPECT_TRUE(ComparePoses(one, one).pair_deg.empty());
  EXPECT_EQ(ComparePoses(one, one).registered, 1);
  EXPECT_EQ(ComparePoses(one, Reconstruction()).images, 0);
}

}  // namespace
}  // namespace holba
