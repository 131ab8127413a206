// SPDX-License-Identifier: BSD-3-Clause
#include "apps/bench/solver_run.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <stdexcept>
#include <vector>

#include "holba/base/error.h"

namespace holba {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::SizeIs;

TEST(TimeToCost, IsTheTimeOfTheFirstAcceptedIterationThatIsGoodEnough) {
  const std::vector<LoggedIteration> log = {{0.5, 100.0, true},
                                            {1.0, 50.0, true},
                                            {2.0, 9.0, false},
                                            {4.0, 10.0, true},
                                            {8.0, 5.0, true}};
  EXPECT_EQ(TimeToCost(0.25, log, 100.0), 0.75);
  EXPECT_EQ(TimeToCost(0.25, log, 60.0), 1.75);
  EXPECT_EQ(TimeToCost(0.25, log, 10.0), 7.75) << "a rejected step reaches nothing, but takes time";
  EXPECT_EQ(TimeToCost(0.25, log, 4.0), std::nullopt);
  EXPECT_EQ(TimeToCost(0.25, {}, 4.0), std::nullopt);
}

TEST(Competitors, AreThoseWhoseNamesBeginAsAskedForEveryNumberOfThreads) {
  const std::vector<int> threads = {1, 2};
  const std::vector<std::string> prefixes = {"ceres_dense", "native"};
  const std::vector<Competitor> chosen = Competitors(threads, prefixes);
  for (const Competitor& c : chosen) {
    EXPECT_TRUE(c.name.starts_with("ceres_dense") || c.name.starts_with("native"));
  }
  const auto lapack = std::count_if(chosen.begin(), chosen.end(), [](const Competitor& c) {
    return c.dense_library == CeresDenseLibrary::kLapack && !c.IsNative();
  });
  EXPECT_EQ(lapack, 2);
  EXPECT_GT(Competitors(threads, {}).size(), chosen.size());
  const std::vector<std::string> unknown = {"g2o"};
  EXPECT_THROW(Competitors(threads, unknown), InputError);
}

TEST(WhySkipped, TellsWhatIsHopeless) {
  const Competitor sparse = {.linear_solver = LinearSolver::kSparse};
  const Competitor eigen = {.linear_solver = LinearSolver::kDense,
                            .dense_library = CeresDenseLibrary::kEigen};
  const Competitor lapack = {.linear_solver = LinearSolver::kDense,
                             .dense_library = CeresDenseLibrary::kLapack};
  const Competitor plain = {.program = SolverProgram::kPlainCeres};
  EXPECT_EQ(WhySkipped(sparse, false, 100000), "");
  EXPECT_EQ(WhySkipped(eigen, false, 3000), "");
  EXPECT_NE(WhySkipped(eigen, false, 3001), "");
  EXPECT_EQ(WhySkipped(lapack, false, 6000), "");
  EXPECT_NE(WhySkipped(lapack, false, 6001), "");
  EXPECT_EQ(WhySkipped(plain, true, 100), "");
  EXPECT_NE(WhySkipped(plain, false, 100), "");
}

TEST(TakesExactSteps, IsFalseForConjugateGradients) {
  EXPECT_TRUE(TakesExactSteps("DENSE_SCHUR (LAPACK)"));
  EXPECT_TRUE(TakesExactSteps("SPARSE_SCHUR (SuiteSparse)"));
  EXPECT_FALSE(TakesExactSteps("ITERATIVE_SCHUR (SCHUR_JACOBI)"));
  EXPECT_FALSE(TakesExactSteps("conjugate gradients, implicit, block Jacobi"));
}

TEST(RunInChild, BringsEveryNumberBack) {
  const SolverRun back = RunInChild(
      [] {
        SolverRun run;
        run.used_solver = "DENSE";
        run.build_seconds = 0.1;
        run.final_cost = std::numeric_limits<double>::infinity();
        run.num_iterations = 7;
        run.log = {{0.5, 3.0, true}, {0.25, 2.0, false}};
        run.seconds = {1e-3, 1.0 / 3.0};
        return run;
      },
      60.0);
  EXPECT_EQ(back.failure, "");
  EXPECT_EQ(back.used_solver, "DENSE");
  EXPECT_EQ(back.build_seconds, 0.1);
  EXPECT_TRUE(std::isinf(back.final_cost));
  EXPECT_EQ(back.num_iterations, 7);
  ASSERT_THAT(back.log, SizeIs(2));
  EXPECT_EQ(back.log[1].cost, 2.0);
  EXPECT_FALSE(back.log[1].accepted);
  EXPECT_THAT(back.seconds, ElementsAre(1e-3, 1.0 / 3.0));
}

TEST(RunInChild, SurvivesWhatEndsTheChild) {
  EXPECT_THAT(
      RunInChild([]() -> SolverRun { throw std::runtime_error("no memory"); }, 60.0).failure,
      HasSubstr("no memory"));
  EXPECT_THAT(RunInChild([]() -> SolverRun { _exit(1); }, 60.0).failure, HasSubstr("no result"));
  EXPECT_THAT(RunInChild(
                  []() -> SolverRun {
                    pause();
                    return {};
                  },
                  0.05)
                  .failure,
              HasSubstr("ended after"));
}

SolverProblem SmallProblem() {
  SolverProblemOptions options;
  options.names = {"ring_12"};
  options.bundle[TermFamily::kPoint].loss = LossChoice::kTrivial;
  options.bundle.refine_focal_length = options.bundle.refine_extra_params = false;
  return SolverProblemSources(options).at(0).make();
}

TEST(RunSolver, RunsAllIterationsAlsoBeyondConvergence) {
  RunOptions options;
  options.iterations = 60;
  const SolverRun run = RunSolver(
      SmallProblem(), {.name = "ceres_dense", .linear_solver = LinearSolver::kDense}, options);
  EXPECT_EQ(run.failure, "");
  EXPECT_EQ(run.num_iterations, 60);
  EXPECT_LT(run.final_cost, run.initial_cost);
  EXPECT_FALSE(run.seconds.empty());
  EXPECT_NEAR(run.log.front().cost, run.initial_cost, 1e-12 * run.initial_cost);
  EXPECT_GT(run.linearise_seconds, 0.0);
}

TEST(RunSolver, StopsWhereTheCostHardlyChanges) {
  RunOptions options;
  options.mode = RunMode::kConverged;
  options.solver.function_tolerance = 1e-3;
  const SolverRun run = RunSolver(
      SmallProblem(), {.name = "ceres_dense", .linear_solver = LinearSolver::kDense}, options);
  EXPECT_EQ(run.stop_reason, "converged");
  EXPECT_LT(run.num_iterations, 15);
  EXPECT_EQ(run.log.size(), static_cast<size_t>(run.num_iterations) + 1);
  EXPECT_NEAR(run.log.back().cost, run.final_cost, 1e-9 * run.final_cost);
}

TEST(RunSolver, BuildsTheProblemAnewForEveryCall) {
  RunOptions options;
  options.mode = RunMode::kCalls;
  options.calls = 3;
  const SolverRun run = RunSolver(
      SmallProblem(), {.name = "ceres_dense", .linear_solver = LinearSolver::kDense}, options);
  EXPECT_THAT(run.seconds, SizeIs(3));
  EXPECT_EQ(run.num_iterations % 3, 0);
  EXPECT_GT(run.initial_cost, run.final_cost) << "also the last call began at the start";
}

}  // namespace
}  // namespace holba
