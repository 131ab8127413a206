// SPDX-License-Identifier: BSD-3-Clause
// The law of origin and unit for the whole of refine: what is built, where it ends up and how sure
// it is does not depend on where the origin of the model is nor on its unit of length.
#include <gtest/gtest.h>

#include <tuple>

#include "holba/bundle/origin_law_testing.h"
#include "holba/bundle/uncertainty.h"
#include "holba/sfm/refine.h"
#include "holba/sfm/refine_testing.h"

namespace holba {
namespace {

struct Result : Located {
  RefineReport report;
};

Result Refine(const Sim3d& new_from_old, Backend backend) {
  const RefineScene scene = MakeRefineScene({});
  Result result;
  result.model = Perturbed(scene.house.model, 0.3, 0.03, 6);
  result.model.Transform(new_from_old);
  RefineOptions options;
  options.solver.backend = backend;
  options.solver.num_threads = 1;
  // The law is one of optima: the noise, which is measured on the residuals and is a factor of all
  // covariances, differs in proportion to how far from it two runs stop.
  options.solver.function_tolerance = 1e-12;
  const auto match = [&](const Reconstruction&) { return scene.matches; };
  result.report = RefineModel(options, scene.house.features, match, {}, &result.model, {});
  const auto uncertainty = EstimateUncertainty(result.model, result.report.stage1_options,
                                               result.report.stage1, options.solver.num_threads);
  EXPECT_TRUE(uncertainty);
  if (uncertainty) result.uncertainty = *uncertainty;
  return result;
}

class RefineOriginLaw : public testing::TestWithParam<std::tuple<double, double, Backend>> {};

TEST_P(RefineOriginLaw, StructurePosesCostAndCovariancesAreTheSame) {
  const auto [offset, unit, backend] = GetParam();
  Sim3d new_from_old;
  new_from_old.scale = unit;
  new_from_old.translation = unit * offset * Eigen::Vector3d(0.09, 1.0, -0.3);
  const Result here = Refine(Sim3d(), backend);
  const Result there = Refine(new_from_old, backend);
  EXPECT_GT(here.model.lines3D.size(), 20u);
  EXPECT_GT(here.uncertainty.lines.size(), 20u);
  const SolverSummary &a = here.report.stage1.solver, &b = there.report.stage1.solver;
  EXPECT_NEAR(b.final_cost, a.final_cost, 1e-6 * a.final_cost);
  ASSERT_EQ(here.model.groups3D.size(), there.model.groups3D.size());
  for (const auto& [id, group] : here.model.groups3D) {
    const Group3D& other = there.model.groups3D.at(id);
    EXPECT_EQ(group.type, other.type) << id;
    EXPECT_EQ(group.point3D_ids, other.point3D_ids) << id;
    EXPECT_EQ(group.line3D_ids, other.line3D_ids) << id;
  }
  EXPECT_EQ(here.model.wireframe.size(), there.model.wireframe.size());
  ExpectTheSameElsewhere(new_from_old, here, there, 1e-6, 1e-6);
}

INSTANTIATE_TEST_SUITE_P(Scenes, RefineOriginLaw,
                         testing::Values(std::tuple(0.0, 1e-3, Backend::kNative),
                                         std::tuple(5.4e6, 1.0, Backend::kNative),
                                         std::tuple(1e7, 1e6, Backend::kNative),
#ifdef HOLBA_WITH_CERES
                                         std::tuple(1e7, 1e-3, Backend::kCeres),
#endif
                                         std::tuple(1e7, 1e-3, Backend::kNative)));

}  // namespace
}  // namespace holba
