// SPDX-License-Identifier: BSD-3-Clause
// Solving with the gauge freed gives what solving with the gauge held gives, in the same frame.
#include "holba/bundle/free_gauge.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>

#include "holba/bundle/adjust_bundle.h"
#include "holba/bundle/bundle_testing.h"
#include "holba/synthetic/bundle_problem.h"

namespace holba {
namespace {

struct FreedCase {
  const char* name;
  bool primitives, rigs;
};

class FreedGaugeOf : public testing::TestWithParam<FreedCase> {
 protected:
  FreedGaugeOf() {
    BundleProblemOptions scene;
    scene.num_images = 16;
    scene.seed = 4;
    scene.visibility = Visibility::kNear;
    scene.primitives = GetParam().primitives ? 1 : 0;
    scene.vps = true;
    scene.rig_size = GetParam().rigs ? 2 : 1;
    problem = MakeBundleProblem(scene);
  }
  SyntheticProblem problem;
};
std::string NameOfCase(const testing::TestParamInfo<FreedCase>& info) { return info.param.name; }
INSTANTIATE_TEST_SUITE_P(Scenes, FreedGaugeOf,
                         testing::Values(FreedCase{"Planes", false, false},
                                         FreedCase{"Primitives", true, false},
                                         FreedCase{"Rigs", false, true}),
                         NameOfCase);

TEST_P(FreedGaugeOf, GivesTheOptimumThatHoldingItGives) {
  const BundleOptions options = PlainOptions();
  SolverOptions solver = TightSolver();
  solver.linear_solver = LinearSolver::kDense;
  BundleProblem held = BuildProblem(problem.perturbed, options);
  BundleProblem free = BuildProblem(problem.perturbed, options);
  const SolverSummary with_held = Solve(solver, &held.problem);

  const std::optional<FreedGauge> freed = FreeGauge(&free);
  ASSERT_TRUE(freed.has_value());
  EXPECT_EQ(freed->second.has_value(), !GetParam().rigs) << "a baseline holds the scale";
  EXPECT_EQ(NumKeptUnknowns(free.problem), NumKeptUnknowns(held.problem) + (freed->second ? 7 : 6));
  const SolverSummary with_free = Solve(solver, &free.problem);
  RestoreGauge(*freed, true, &free);

  EXPECT_NEAR(with_free.final_cost, with_held.final_cost, 1e-9 * with_held.final_cost);
  EXPECT_EQ(NumKeptUnknowns(free.problem), NumKeptUnknowns(held.problem));
  for (BlockId id = 0; id < held.problem.num_blocks(); ++id) {
    const ParameterBlock& block = held.problem.block(id);
    double difference[kMaxTangent];
    block.manifold->minus(held.problem.values(id), free.problem.values(id), difference);
    for (int i = 0; i < block.manifold->tangent; ++i)
      EXPECT_NEAR(difference[i], 0.0, 1e-4) << block.kind << " " << id;
  }
  // What is held has its bits.
  const auto same_bits = [&](BlockId id, int from, int count) {
    const BundleProblem start = BuildProblem(problem.perturbed, options);
    return std::memcmp(start.problem.values(id) + from, free.problem.values(id) + from,
                       count * sizeof(double)) == 0;
  };
  EXPECT_TRUE(same_bits(freed->first, 0, 7));
  if (freed->second) {
    EXPECT_TRUE(same_bits(*freed->second, 4 + freed->coordinate, 1));
    EXPECT_FALSE(same_bits(*freed->second, 0, 4));
  }
}

TEST_P(FreedGaugeOf, ChangesNoCostOnTheWayBack) {
  BundleProblem bundle = BuildProblem(problem.perturbed, PlainOptions());
  const std::optional<FreedGauge> freed = FreeGauge(&bundle);
  ASSERT_TRUE(freed.has_value());
  SolverOptions solver;
  solver.max_num_iterations = 2;
  Solve(solver, &bundle.problem);
  const std::vector<TermCost> before = EvaluateTerms(bundle.problem);
  RestoreGauge(*freed, true, &bundle);
  const std::vector<TermCost> after = EvaluateTerms(bundle.problem);
  for (size_t i = 0; i < before.size(); ++i) {
    EXPECT_NEAR(after[i].sum_squares, before[i].sum_squares, 1e-9 * before[i].sum_squares)
        << before[i].term;
  }
}

TEST(FreeGauge, RefusesWhatDependsOnTheFrame) {
  BundleProblemOptions scene;
  scene.num_images = 10;
  const SyntheticProblem problem = MakeBundleProblem(scene);
  const auto can_be_freed = [&](const BundleOptions& options) {
    BundleProblem bundle = BuildProblem(problem.perturbed, options);
    const size_t unknowns = NumKeptUnknowns(bundle.problem);
    const bool freed = FreeGauge(&bundle).has_value();
    EXPECT_EQ(NumKeptUnknowns(bundle.problem), unknowns + (freed ? 7 : 0));
    return freed;
  };
  EXPECT_TRUE(can_be_freed(PlainOptions()));
  for (bool BundleOptions::*fixed :
       {&BundleOptions::fix_poses, &BundleOptions::fix_points, &BundleOptions::fix_lines,
        &BundleOptions::fix_groups}) {
    BundleOptions options = PlainOptions();
    options.*fixed = true;
    EXPECT_FALSE(can_be_freed(options));
  }
  BundleOptions options = PlainOptions();
  options.gauge = Gauge::kFree;
  EXPECT_FALSE(can_be_freed(options)) << "nothing is held";
  options = PlainOptions();
  options.wireframe_form = StructureForm::k3d;
  EXPECT_FALSE(can_be_freed(options));
  // A point that is seen once does not move.
  Reconstruction model = problem.perturbed;
  model.points3D.begin()->second.track.resize(1);
  BundleOptions points_only = PlainOptions();
  points_only.config = BundleConfig::kPoint;
  BundleProblem bundle = BuildProblem(model, points_only);
  EXPECT_FALSE(FreeGauge(&bundle).has_value());
}

}  // namespace
}  // namespace holba
