// SPDX-License-Identifier: BSD-3-Clause
// The backend petsc finds what the native one finds, on any number of ranks: ctest runs this
// program alone and under mpirun with 2, 3 and 4 of them.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <mpi.h>

#include <cmath>
#include <string>

#include "holba/solver/distributed/rank_counts.h"
#include "holba/solver/ranks.h"
#include "holba/solver/small_bundle_testing.h"
#include "holba/solver/solver.h"

namespace holba {
namespace {

SolverOptions Tight(Backend backend, LinearSolver linear_solver = LinearSolver::kAuto) {
  SolverOptions options;
  options.backend = backend;
  options.linear_solver = linear_solver;
  options.num_threads = 1;
  options.max_num_iterations = 60;
  options.function_tolerance = options.parameter_tolerance = 1e-14;
  options.gradient_tolerance = 1e-9;
  options.eta = 1e-4;
  return options;
}

// Whether all ranks have the same doubles, bit for bit.
void ExpectSameOnAllRanks(const std::vector<double>& values) {
  std::vector<double> of_first = values;
  MPI_Bcast(of_first.data(), static_cast<int>(of_first.size()), MPI_DOUBLE, 0, MPI_COMM_WORLD);
  EXPECT_EQ(values, of_first);
}

void ExpectSamePoses(const SmallBundle& a, const SmallBundle& b) {
  for (BlockId pose : a.poses) {
    for (int i = 0; i < 7; ++i)
      EXPECT_NEAR(a.problem.values(pose)[i], b.problem.values(pose)[i], 1e-6);
  }
}

struct Case {
  std::string name;
  LinearSolver linear_solver = LinearSolver::kAuto;
  std::string petsc_options;
  LossType loss = LossType::kTrivial;
  bool refine_focal_length = true;
  int num_points = 300, num_poses = 24, window = 4;
};

class OnRanks : public testing::TestWithParam<Case> {
 protected:
  OnRanks() { ranks::Begin(GetParam().petsc_options); }
  SmallBundle Make() const {
    const Case& c = GetParam();
    SmallBundle bundle(0.5, c.refine_focal_length, c.loss, c.num_points, c.num_poses, c.window);
    bundle.Perturb(7);
    return bundle;
  }
  SolverOptions Options() const {
    SolverOptions options = Tight(Backend::kPetsc, GetParam().linear_solver);
    options.petsc_options = GetParam().petsc_options;
    return options;
  }
};

TEST_P(OnRanks, FindTheOptimumOfTheNativeSolver) {
  SmallBundle with = Make(), native = Make();
  const SolverSummary a = Solve(Options(), &with.problem);
  const SolverSummary b = Solve(Tight(Backend::kNative), &native.problem);
  EXPECT_EQ(a.backend, "petsc");
  EXPECT_NEAR(a.initial_cost, b.initial_cost, 1e-12 * b.initial_cost);
  EXPECT_NEAR(a.final_cost, b.final_cost, 1e-9 * b.final_cost);
  EXPECT_LT(a.final_cost, 0.5 * a.initial_cost);
  ASSERT_EQ(a.final_terms.size(), b.final_terms.size());
  EXPECT_EQ(a.final_terms[0].residuals, b.final_terms[0].residuals);
  EXPECT_EQ(a.reduced_system.size, b.reduced_system.size);
  ExpectSamePoses(with, native);
  ExpectSameOnAllRanks(with.problem.state());
}

TEST_P(OnRanks, RepeatBitForBit) {
  if (!GetParam().petsc_options.empty())
    GTEST_SKIP() << "some of PETSc's solvers add up in the order of arrival";
  SolverOptions options = Options();
  options.max_num_iterations = 3;
  SolverWorkspace workspace;
  SmallBundle first = Make(), second = Make(), third = Make();
  const SolverSummary a = Solve(options, &first.problem, &workspace);
  const SolverSummary b = Solve(options, &second.problem, &workspace);
  const SolverSummary c = Solve(options, &third.problem);
  EXPECT_EQ(first.problem.state(), second.problem.state());
  EXPECT_EQ(first.problem.state(), third.problem.state());
  EXPECT_EQ(a.final_cost, b.final_cost);
  EXPECT_EQ(a.iterations, c.iterations);
}

// One iteration: one assembly, one step.
TEST(RankCounts, AreWhatRanksSend) {
  ranks::Begin();
  for (const bool refine_focal_length : {false, true}) {
    SmallBundle street(0.5, refine_focal_length, LossType::kTrivial, 300, 24, 4);
    street.Perturb(7);
    const auto counts = distributed::CountRanks(street.problem, ranks::Size());
    SolverOptions options = Tight(Backend::kPetsc, LinearSolver::kIterative);
    options.max_num_iterations = 1;
    const SolverSummary summary = Solve(options, &street.problem);
    for (size_t r = 0; r < summary.ranks.size(); ++r) {
      EXPECT_EQ(counts[r].bytes, summary.ranks[r].bytes_per_iteration) << r;
      EXPECT_EQ(counts[r].messages, summary.ranks[r].messages_per_iteration) << r;
      EXPECT_EQ(counts[r].features, summary.ranks[r].features);
      EXPECT_EQ(counts[r].residuals, summary.ranks[r].residuals);
      EXPECT_EQ(counts[r].shared_unknowns, summary.ranks[r].shared_unknowns);
    }
    if (ranks::Size() > 1) {
      EXPECT_GT(counts[0].bytes, 0u);
    }
  }
}

std::string NameOfCase(const testing::TestParamInfo<Case>& info) { return info.param.name; }
INSTANTIATE_TEST_SUITE_P(
    Cases, OnRanks,
    testing::Values(
        Case{"Auto"}, Case{"Dense", LinearSolver::kDense}, Case{"Sparse", LinearSolver::kSparse},
        Case{"ConjugateGradients", LinearSolver::kIterative},
        Case{"Cauchy", LinearSolver::kIterative, "", LossType::kCauchy},
        Case{"HeldIntrinsics", LinearSolver::kIterative, "", LossType::kTrivial, false},
        Case{"SeenByAll", LinearSolver::kAuto, "", LossType::kTrivial, true, 40, 6, 0},
        Case{"FewerPosesThanRanks", LinearSolver::kAuto, "", LossType::kTrivial, false, 12, 3, 0},
        Case{"FewerIterative", LinearSolver::kIterative, "", LossType::kTrivial, false, 12, 3, 0}),
    NameOfCase);

// PETSc keeps its options from one solve to the next: these run in processes of their own
// (CMakeLists.txt), each with --gtest_also_run_disabled_tests and its name.
INSTANTIATE_TEST_SUITE_P(
    DISABLED_Options, OnRanks,
    testing::Values(Case{"Mumps", LinearSolver::kAuto,
                         "-ksp_type preonly -pc_type cholesky -pc_factor_mat_solver_type mumps"},
                    Case{"Schwarz", LinearSolver::kAuto,
                         "-mat_type aij -pc_type asm -pc_asm_overlap 1 -sub_pc_type lu"},
                    Case{"Blocks", LinearSolver::kAuto, "-mat_type baij -pc_type bjacobi"},
                    Case{"PointBlocks", LinearSolver::kAuto, "-mat_type aij -pc_type pbjacobi"}),
    NameOfCase);

}  // namespace
}  // namespace holba
