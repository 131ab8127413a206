// SPDX-License-Identifier: BSD-3-Clause
// The law of origin and unit: an adjustment, and the covariances after it, do not know where the
// origin of the model is nor what its unit of length is.
#include <gtest/gtest.h>

#include <tuple>

#include "holba/bundle/adjust_bundle.h"
#include "holba/bundle/origin_law_testing.h"
#include "holba/bundle/uncertainty.h"
#include "holba/synthetic/bundle_problem.h"

namespace holba {
namespace {

struct Result : Located {
  BundleSummary summary;
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
  ASSERT_GT(here.uncertainty.points.size(), 50u);
  if (config == BundleConfig::kHolistic) {
    EXPECT_EQ(here.uncertainty.lines.size(), here.model.lines3D.size());
  }
  // Offsets of 1e7 round coordinates to 2e-9 units.
  ExpectTheSameElsewhere(new_from_old, here, there, 1e-6, 1e-6);
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
