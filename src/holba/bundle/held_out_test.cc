// SPDX-License-Identifier: BSD-3-Clause
#include "holba/bundle/held_out.h"

#include <gtest/gtest.h>

#include <map>
#include <set>

#include "holba/bundle/adjust_bundle.h"
#include "holba/bundle/bundle_testing.h"
#include "holba/scene/local_frame.h"
#include "holba/synthetic/bundle_problem.h"

namespace holba {
namespace {

const SyntheticProblem& Scene() {
  static const SyntheticProblem scene =
      MakeBundleProblem({.seed = 3, .num_images = 15, .observation_noise_px = 0.5, .vps = true});
  return scene;
}

std::set<point3D_t> Ids(const std::vector<Selected<point3D_t>>& points) {
  std::set<point3D_t> ids;
  for (const auto& point : points) ids.insert(point.id);
  return ids;
}

TEST(HeldOutPoints, LeavesEachPointAndLineOutOnce) {
  const Reconstruction& model = Scene().truth;
  const BundleSelection all = BundleSelection::Everything(model, {});
  const HeldOutPoints held_out(model, all);
  std::map<point3D_t, int> points;
  std::map<line3D_t, int> lines;
  for (size_t fold = 0; fold < HeldOutPoints::kNumFolds; ++fold) {
    const BundleSelection seen = held_out.Without(fold, all);
    for (const auto& point : seen.points) ++points[point.id];
    for (const auto& line : seen.lines) ++lines[line.id];
    // Regions are halves of halves: folds of like size.
    const double share = static_cast<double>(seen.points.size() + seen.lines.size()) /
                         static_cast<double>(all.points.size() + all.lines.size());
    EXPECT_NEAR(share, 1.0 - 1.0 / HeldOutPoints::kNumFolds, 0.03);
  }
  ASSERT_EQ(points.size(), all.points.size());
  for (const auto& [id, count] : points) EXPECT_EQ(count, HeldOutPoints::kNumFolds - 1);
  ASSERT_EQ(lines.size(), all.lines.size());
  for (const auto& [id, count] : lines) EXPECT_EQ(count, HeldOutPoints::kNumFolds - 1);
}

TEST(HeldOutPoints, LeavesNeighboursOutTogether) {
  const Reconstruction& model = Scene().truth;
  const BundleSelection all = BundleSelection::Everything(model, {});
  const HeldOutPoints held_out(model, all);
  size_t num_together = 0, num_points = 0;
  for (size_t fold = 0; fold < HeldOutPoints::kNumFolds; ++fold) {
    const std::set<point3D_t> seen = Ids(held_out.Without(fold, all).points);
    for (const auto& point : all.points) {
      if (seen.contains(point.id)) continue;
      const Eigen::Vector3d& X = model.points3D.at(point.id).xyz;
      double nearest = std::numeric_limits<double>::infinity();
      bool is_left_out = false;
      for (const auto& other : all.points) {
        const double distance = (model.points3D.at(other.id).xyz - X).norm();
        if (other.id == point.id || distance >= nearest) continue;
        nearest = distance;
        is_left_out = !seen.contains(other.id);
      }
      ++num_points;
      num_together += is_left_out;
    }
  }
  EXPECT_EQ(num_points, all.points.size());
  // By chance a quarter would be; at the borders of regions some are not.
  EXPECT_GT(num_together, num_points * 6 / 10);
}

TEST(HeldOutPoints, JudgesWhatThreeImagesSeeAndNoStructureMade) {
  ModelMaker maker;
  for (int i = 0; i < 4; ++i) maker.AddImage({i - 1.5, -6.0, 0.3 * i}, {0, 0, 0});
  for (int i = 0; i < 40; ++i) {
    const Eigen::Vector3d X(0.1 * (i % 7), 0.2 * (i % 5), 0.15 * (i % 3));
    maker.AddPoint(X, i < 10 ? std::vector<image_t>{1, 2} : std::vector<image_t>{1, 2, 3});
  }
  maker.Finish();
  for (point3D_t id = 115; id < 120; ++id)
    maker.model.points3D.at(id).origin = PointOrigin::kCorner;
  const BundleSelection all = BundleSelection::Everything(maker.model, {});
  const HeldOutPoints held_out(maker.model, all);
  size_t num_judged = 0;
  for (size_t fold = 0; fold < HeldOutPoints::kNumFolds; ++fold)
    num_judged += held_out.NumJudged(fold);
  EXPECT_EQ(num_judged, 25u);
}

TEST(HeldOutPoints, CostNothingWhereObservationsAreExact) {
  ModelMaker maker;
  for (int i = 0; i < 4; ++i) maker.AddImage({i - 1.5, -6.0, 0.3 * i}, {0, 0, 0});
  for (int i = 0; i < 40; ++i)
    maker.AddPoint({0.1 * (i % 7), 0.2 * (i % 5), 0.15 * (i % 3)}, {1, 2, 3, 4});
  maker.Finish();
  const HeldOutPoints held_out(maker.model, BundleSelection::Everything(maker.model, {}));
  // Where the search begins does not matter.
  for (auto& [id, point] : maker.model.points3D) point.xyz += Eigen::Vector3d(0.05, -0.1, 0.04);
  for (double cost : held_out.PredictionCosts(1, maker.model, 1.0, 1)) EXPECT_LT(cost, 1e-12);
}

// Independently: the solver places the points, cameras held.
TEST(HeldOutPoints, CostWhatTheSolverFindsWithTheCamerasHeld) {
  const Reconstruction& model = Scene().truth;
  const BundleSelection all = BundleSelection::Everything(model, {});
  const HeldOutPoints held_out(model, all);
  constexpr double kScale = 0.8;
  double sum = 0.0;
  for (double cost : held_out.PredictionCosts(2, model, kScale, 2)) sum += cost;

  const std::set<point3D_t> seen = Ids(held_out.Without(2, all).points);
  BundleSelection left_out = all;
  std::erase_if(left_out.points, [&](const auto& point) { return seen.contains(point.id); });
  left_out.HoldCameras();
  BundleOptions options = PlainOptions(LossChoice::kCauchy);
  options.config = BundleConfig::kPoint;
  options[TermFamily::kPoint].loss_scale = kScale;
  BundleProblem bundle = BuildProblem(model, options, left_out);
  const double cost = Solve(TightSolver(), &bundle.problem).final_cost;
  // Half of scale^2 log(1 + r^2 / scale^2). All points of the scene have three images and more.
  EXPECT_EQ(bundle.points.size(), held_out.NumJudged(2));
  EXPECT_NEAR(0.5 * kScale * kScale * sum, cost, 1e-6 * cost);
}

TEST(HeldOutPoints, CostTheSameWithAnyNumberOfThreads) {
  const HeldOutPoints held_out(Scene().truth, BundleSelection::Everything(Scene().truth, {}));
  EXPECT_EQ(held_out.PredictionCosts(0, Scene().truth, 1.0, 1),
            held_out.PredictionCosts(0, Scene().truth, 1.0, 3));
}

TEST(MeanDifference, HasTheStandardErrorOfPairs) {
  // Differences 1, 2, 3, 6: mean 3, variance 14 / 3, of the mean 14 / 12.
  const PairedMean mean = MeanDifference({11, 22, 33, 46}, {10, 20, 30, 40});
  EXPECT_DOUBLE_EQ(mean.mean, 3.0);
  EXPECT_DOUBLE_EQ(mean.standard_error, std::sqrt(14.0 / 12.0));
}

}  // namespace
}  // namespace holba
