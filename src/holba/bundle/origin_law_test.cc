// SPDX-License-Identifier: BSD-3-Clause
// The law of origin and unit: an adjustment, and the covariances after it, do not know where the
// origin of the model is nor what its unit of length is.
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <tuple>

#include "holba/bundle/adjust_bundle.h"
#include "holba/bundle/uncertainty.h"
#include "holba/synthetic/bundle_problem.h"

namespace holba {
namespace {

struct Result {
  Reconstruction model;
  BundleSummary summary;
  ModelUncertainty uncertainty;
};

Result Adjust(const Sim3d& new_from_old, BundleConfig config, Backend backend) {
  Result result;
  result.model = MakeBundleProblem({.seed = 11, .num_images = 12, .vps = true}).perturbed;
  result.model.Transform(new_from_old);
  BundleOptions options;
  options.config = config;
  SolverOptions solver;
  solver.backend = backend;
  result.summary = AdjustBundle(options, solver, &result.model);
  const auto uncertainty = EstimateUncertainty(result.model, options, result.summary, 1);
  EXPECT_TRUE(uncertainty);
  if (uncertainty) result.uncertainty = *uncertainty;
  return result;
}

// Of a camera's centre, in units of the model: C = -R^T t.
Eigen::Matrix3d CentreCovariance(const Rigid3d& pose, const Matrix6d& covariance) {
  const Eigen::Matrix3d R = pose.rotation.toRotationMatrix();
  Eigen::Matrix<double, 3, 6> J;
  J << -R.transpose() * CrossMatrix(pose.translation), -R.transpose();
  return J * covariance * J.transpose();
}

class OriginLaw : public testing::TestWithParam<std::tuple<double, double, BundleConfig, Backend>> {
};

TEST_P(OriginLaw, CostPosesAndCovariancesAreTheSame) {
  const auto [offset, unit, config, backend] = GetParam();
  Sim3d new_from_old;
  new_from_old.scale = unit;
  new_from_old.translation = unit * offset * Eigen::Vector3d(0.09, 1.0, -0.3);
  const Result here = Adjust(Sim3d(), config, backend);
  const Result there = Adjust(new_from_old, config, backend);
  const SolverSummary &a = here.summary.solver, &b = there.summary.solver;
  EXPECT_NEAR(b.initial_cost, a.initial_cost, 1e-6 * a.initial_cost);
  EXPECT_NEAR(b.final_cost, a.final_cost, 1e-6 * a.final_cost);
  EXPECT_LT(a.final_cost, 0.2 * a.initial_cost);
  // Offsets of 1e7 round coordinates to 2e-9 units.
  const double tolerance = 1e-6;
  const Sim3d old_from_new = new_from_old.Inverse();
  for (const auto& [id, frame] : here.model.frames) {
    const Rigid3d &p = frame.rig_from_world, &q = there.model.frames.at(id).rig_from_world;
    EXPECT_LT(p.rotation.angularDistance(q.rotation), tolerance);
    EXPECT_LT((p.OriginInA() - old_from_new * q.OriginInA()).norm(), tolerance);
  }
  for (const auto& [id, point] : here.model.points3D) {
    EXPECT_LT((point.xyz - old_from_new * there.model.points3D.at(id).xyz).norm(),
              10.0 * tolerance);
  }
  ASSERT_EQ(here.uncertainty.poses.size(), there.uncertainty.poses.size());
  ASSERT_EQ(here.uncertainty.points.size(), there.uncertainty.points.size());
  ASSERT_GT(here.uncertainty.points.size(), 50u);
  // Covariances follow from Jacobians at slightly different places.
  const double relative = 1e-4;
  for (const auto& [id, C] : here.uncertainty.points) {
    const Eigen::Matrix3d D = there.uncertainty.points.at(id) / (unit * unit);
    EXPECT_LT((C - D).norm(), relative * C.norm());
  }
  for (const auto& [id, C] : here.uncertainty.poses) {
    const Matrix6d& D = there.uncertainty.poses.at(id);
    const Eigen::Matrix3d rotation = C.topLeftCorner<3, 3>();
    const Eigen::Matrix3d rotation_there = D.topLeftCorner<3, 3>();
    EXPECT_LE((rotation - rotation_there).norm(), relative * rotation.norm());
    const Eigen::Matrix3d of_centre = CentreCovariance(here.model.frames.at(id).rig_from_world, C);
    const Eigen::Matrix3d there_too =
        CentreCovariance(there.model.frames.at(id).rig_from_world, D) / (unit * unit);
    // The covariance of t grows with the square of the offset; of the centre it is the small
    // difference of such numbers.
    const double rounding = 4e-15 * offset * offset * rotation.norm();
    EXPECT_LE((of_centre - there_too).norm(), relative * of_centre.norm() + rounding);
  }
}

constexpr Backend kBackends[] = {
    Backend::kNative,
#ifdef HOLBA_WITH_CERES
    Backend::kCeres,
#endif
};

INSTANTIATE_TEST_SUITE_P(
    Scenes, OriginLaw,
    testing::Combine(testing::Values(0.0, 5.4e6, 1e7), testing::Values(1e-3, 1.0, 1e6),
                     testing::Values(BundleConfig::kPoint, BundleConfig::kHolistic),
                     testing::ValuesIn(kBackends)));

}  // namespace
}  // namespace holba
