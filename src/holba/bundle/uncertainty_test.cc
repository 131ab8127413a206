// SPDX-License-Identifier: BSD-3-Clause
#include "holba/bundle/uncertainty.h"

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>

#include "holba/synthetic/bundle_problem.h"

namespace holba {
namespace {

// A scene with true poses (held) and noisy observations, adjusted by squares alone.
struct Adjusted {
  SyntheticProblem scene;
  BundleOptions options;
  BundleSummary summary;
  ModelUncertainty uncertainty;
};

Adjusted AdjustScene(BundleConfig config, bool fix_poses) {
  Adjusted a;
  BundleProblemOptions scene;
  scene.seed = 7;
  scene.num_images = 40;
  scene.vps = true;
  if (fix_poses) scene.rotation_noise_deg = scene.translation_noise = 0.0;
  a.scene = MakeBundleProblem(scene);
  a.options.config = config;
  a.options.fix_poses = fix_poses;
  a.options.refine_focal_length = false;
  for (TermSettings& term : a.options.terms) term.loss = LossChoice::kTrivial;
  a.summary = AdjustBundle(a.options, SolverOptions(), &a.scene.perturbed);
  a.uncertainty = *EstimateUncertainty(a.scene.perturbed, a.options, a.summary, 2);
  return a;
}

// Errors measured in their own covariances: the mean of chi-square is its degrees of freedom. Their
// standard error over n features is sqrt(2 dof / n).
TEST(Uncertainty, ErrorsOfFeaturesAreAsLargeAsTheirCovariancesSay) {
  const Adjusted a = AdjustScene(BundleConfig::kPointLine, true);
  EXPECT_NEAR(a.uncertainty.sigma_px, 1.0, 0.15);  // of fitted residuals: a little less than 1
  const double inflation = 1.0 / (a.uncertainty.sigma_px * a.uncertainty.sigma_px);
  double sum = 0.0;
  for (const auto& [id, C] : a.uncertainty.points) {
    const Eigen::Vector3d e =
        a.scene.perturbed.points3D.at(id).xyz - a.scene.truth.points3D.at(id).xyz;
    sum += e.dot((inflation * C).ldlt().solve(e));
  }
  EXPECT_EQ(a.uncertainty.points.size(), a.scene.truth.points3D.size());
  EXPECT_NEAR(sum / static_cast<double>(a.uncertainty.points.size()), 3.0, 0.4);

  sum = 0.0;
  for (const auto& [id, C] : a.uncertainty.lines) {
    const Line3D& line = a.scene.perturbed.lines3D.at(id);
    const Eigen::Vector3d e =
        line.start - a.scene.truth.lines3D.at(id).line.ClosestPoint(line.start);
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(inflation * C.start);
    // Nothing along the line.
    EXPECT_LT(eigen.eigenvalues()[0], 1e-9 * eigen.eigenvalues()[2]);
    EXPECT_GT(std::abs(eigen.eigenvectors().col(0).dot(line.line.direction)), 1.0 - 1e-9);
    for (int k = 1; k < 3; ++k)
      sum += std::pow(eigen.eigenvectors().col(k).dot(e), 2) / eigen.eigenvalues()[k];
  }
  EXPECT_EQ(a.uncertainty.lines.size(), a.scene.truth.lines3D.size());
  EXPECT_NEAR(sum / static_cast<double>(a.uncertainty.lines.size()), 2.0, 0.7);
}

TEST(Uncertainty, GroupsHaveTheCovarianceOfTheirFileParameters) {
  const Adjusted a = AdjustScene(BundleConfig::kHolistic, true);
  size_t planes = 0;
  for (const auto& [id, C] : a.uncertainty.groups) {
    const Group3D& group = a.scene.perturbed.groups3D.at(id);
    ASSERT_EQ(C.rows(), group.type->num_file_params);
    EXPECT_LT((C - C.transpose()).norm(), 1e-12 * C.norm());
    // A unit vector cannot change along itself.
    const Eigen::Vector3d n(group.params[0], group.params[1], group.params[2]);
    const Eigen::Matrix3d of_direction = C.topLeftCorner(3, 3);
    EXPECT_LT((of_direction * n).norm(), 1e-6 * of_direction.norm());
    planes += group.type->name == "PLANE";
  }
  EXPECT_EQ(planes, a.scene.truth.groups3D.size() - 3);
}

TEST(Uncertainty, StructureThatDoesNotMoveCamerasMakesThemNoSurer) {
  const Adjusted points = AdjustScene(BundleConfig::kPoint, false);
  Adjusted a = AdjustScene(BundleConfig::kHolistic, false);
  a.summary.weight_choice.weights.points_alone = true;
  const ModelUncertainty held = *EstimateUncertainty(a.scene.perturbed, a.options, a.summary, 2);
  EXPECT_EQ(held.lines.size(), a.scene.truth.lines3D.size());
  EXPECT_EQ(held.groups.size(), a.uncertainty.groups.size());
  double held_sum = 0.0, points_sum = 0.0, free_sum = 0.0;
  for (const auto& [id, C] : held.poses) {
    held_sum += C.trace();
    points_sum += points.uncertainty.poses.at(id).trace();
    free_sum += a.uncertainty.poses.at(id).trace();
  }
  EXPECT_NEAR(held_sum, points_sum, 0.05 * points_sum);
  EXPECT_LT(free_sum, 0.95 * held_sum);
}

TEST(Uncertainty, ThePoseThatTheGaugeHoldsHasNone) {
  const Adjusted a = AdjustScene(BundleConfig::kPointLine, false);
  ASSERT_EQ(a.uncertainty.poses.size(), a.scene.truth.frames.size());
  const frame_t first = a.scene.truth.frames.begin()->first;
  for (const auto& [id, C] : a.uncertainty.poses) {
    if (id == first) {
      EXPECT_TRUE(C.isZero(0.0));
    } else {
      // One degree of noise was put in; thousands of observations of 1 px leave far less.
      EXPECT_GT(C(0, 0), 0.0);
      EXPECT_LT(C.diagonal().head<3>().maxCoeff(), std::pow(0.01, 2));
    }
  }
}

}  // namespace
}  // namespace holba
