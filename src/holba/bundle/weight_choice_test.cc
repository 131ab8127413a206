// SPDX-License-Identifier: BSD-3-Clause
#include "holba/bundle/weight_choice.h"

#include <gtest/gtest.h>

#include <cmath>

#include "holba/bundle/adjust_bundle.h"
#include "holba/bundle/bundle_testing.h"
#include "holba/evaluation/ground_truth.h"
#include "holba/synthetic/bundle_problem.h"

namespace holba {
namespace {

// Every image's segments are off by so many pixels, each image's in another direction.
void ShiftSegments(double shift_px, Reconstruction* model) {
  for (auto& [id, image] : model->images) {
    const Eigen::Vector2d shift(std::cos(2.4 * id), std::sin(2.4 * id));
    for (auto& line : image.lines2D) {
      line.segment.start += shift_px * shift;
      line.segment.end += shift_px * shift;
    }
  }
}

double RotationError(const Reconstruction& model, const Reconstruction& truth) {
  return CompareToTruth(model, truth)->rotation_deg->rms;
}

TEST(WeightChoice, TakesStructureThatIsRight) {
  const SyntheticProblem scene = MakeBundleProblem({.seed = 5, .num_images = 40, .vps = true});
  Reconstruction model = scene.perturbed, by_points = scene.perturbed;
  const WeightChoice choice = AdjustBundle({}, {}, &model).weight_choice;
  ASSERT_FALSE(choice.weights.points_alone);
  for (const WeightTrial& trial : choice.trials) {
    if (trial.weights == choice.weights) {
      EXPECT_LT(trial.from_points.mean, -2.0 * trial.from_points.standard_error);
    }
  }
  BundleOptions points;
  points.config = BundleConfig::kPoint;
  AdjustBundle(points, {}, &by_points);
  EXPECT_LT(RotationError(model, scene.truth), RotationError(by_points, scene.truth));
}

TEST(WeightChoice, LeavesTheCamerasToThePointsWhereLinesContradictThem) {
  SyntheticProblem scene =
      MakeBundleProblem({.num_images = 20, .observation_noise_px = 0.2, .vps = true});
  ShiftSegments(10.0, &scene.perturbed);
  const auto error = [&](BundleConfig config, bool choose) {
    Reconstruction model = scene.perturbed;
    BundleOptions options;
    options.config = config;
    options.choose_weights = choose;
    AdjustBundle(options, {}, &model);
    EXPECT_EQ(model.FindInconsistency(), std::nullopt);
    return RotationError(model, scene.truth);
  };
  const double by_points = error(BundleConfig::kPoint, true);
  for (const BundleConfig config : {BundleConfig::kPointLine, BundleConfig::kHolistic}) {
    EXPECT_LT(error(config, true), 1.05 * by_points);
    EXPECT_GT(error(config, false), 1.5 * by_points);
  }
}

TEST(WeightChoice, RepeatsWithAnyNumberOfThreads) {
  const SyntheticProblem scene = MakeBundleProblem({.seed = 5, .num_images = 12, .vps = true});
  std::vector<WeightChoice> choices;
  for (const int num_threads : {1, 3}) {
    Reconstruction model = scene.perturbed;
    SolverOptions solver;
    solver.num_threads = num_threads;
    choices.push_back(AdjustBundle({}, solver, &model).weight_choice);
  }
  ASSERT_FALSE(choices[0].trials.empty());
  ASSERT_EQ(choices[0].trials.size(), choices[1].trials.size());
  for (size_t i = 0; i < choices[0].trials.size(); ++i) {
    EXPECT_EQ(choices[0].trials[i].weights, choices[1].trials[i].weights);
    EXPECT_EQ(choices[0].trials[i].from_points.mean, choices[1].trials[i].from_points.mean);
  }
}

TEST(WeightChoice, OfALargeModelIsMadeOnAPartOfIt) {
  const SyntheticProblem scene = MakeBundleProblem({.seed = 2, .num_images = 150});
  Reconstruction model = scene.perturbed;
  const WeightChoice choice = AdjustBundle({}, {}, &model).weight_choice;
  ASSERT_FALSE(choice.trials.empty());
  // 60 of 150 images; a point of which fewer than three are among them is not judged.
  EXPECT_LT(choice.num_tracks, model.points3D.size());
}

TEST(WeightChoice, IsLeftOutWhereAsked) {
  SyntheticProblem scene = MakeBundleProblem({.num_images = 12});
  BundleOptions options;
  options.choose_weights = false;
  EXPECT_TRUE(AdjustBundle(options, {}, &scene.perturbed).weight_choice.trials.empty());
}

// 40 points that three images see hold these; image 4 shares only 20 with others.
TEST(UnverifiedPoints, AreThoseOfTwoImagesThatOthersHoldUp) {
  ModelMaker maker;
  for (int i = 0; i < 4; ++i) maker.AddImage({i - 1.5, -6.0, 0.3 * i}, {0, 0, 0});
  const auto at = [](int i) -> Eigen::Vector3d {
    return {0.1 * (i % 7), 0.2 * (i % 5), 0.15 * (i % 3)};
  };
  for (int i = 0; i < 40; ++i) maker.AddPoint(at(i), {1, 2, 3});
  const point3D_t held_up = maker.AddPoint(at(1), {1, 2});
  const point3D_t needed = maker.AddPoint(at(2), {1, 4});
  const point3D_t corner = maker.AddPoint(at(3), {2, 3});
  const point3D_t twice = maker.AddPoint(at(4), {2, 3, 3});
  maker.Finish();
  maker.model.points3D.at(corner).origin = PointOrigin::kCorner;
  (void)needed;
  const BundleSelection all = BundleSelection::Everything(maker.model, {});
  EXPECT_EQ(UnverifiedPoints(maker.model, all), (std::vector<point3D_t>{held_up, twice}));
}

}  // namespace
}  // namespace holba
