// SPDX-License-Identifier: BSD-3-Clause
#include "apps/bench/solver_bench.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

namespace holba {
namespace {

using ::testing::HasSubstr;
using ::testing::SizeIs;

SolverRun Run(std::vector<double> seconds, double build_seconds, double final_cost) {
  SolverRun run;
  run.seconds = std::move(seconds);
  run.build_seconds = build_seconds;
  run.build_problem_seconds = 0.5;
  run.initial_cost = 100.0;
  run.final_cost = final_cost;
  run.num_iterations = 2;
  run.peak_memory_mb = 3.0;
  run.log = {{0.1, 100.0, true}, {0.2, 1.005 * final_cost, true}, {0.4, final_cost, true}};
  return run;
}

// Native: 2 ms per iteration and done after 0.71 s; Ceres: 6 ms exact, a better cost of 9.99 by
// conjugate gradients; dense is skipped.
SolverBenchResult MadeUpResult() {
  SolverBenchResult result;
  result.peak_gflops_one = 50.0;
  result.peak_gflops_all = 100.0;
  result.all_threads = 2;
  SolverBenchProblemResult problem;
  problem.name = "made_up";
  problem.is_local = true;
  problem.flops.linearise = 1e8;
  problem.flops.dense_factor = 1e9;  // more than the sparse one: does not count
  SolverResult native, sparse, iterative, dense;
  native.competitor = {.name = "native", .backend = Backend::kNative};
  native.timed = {Run({2e-3, 2e-3, 9e-3}, 0.01, 10.0), Run({3e-3}, 0.01, 10.0)};
  native.converged = {Run({}, 0.01, 10.0)};
  native.calls.seconds = {0.02, 0.04, 0.03};
  native.calls.num_iterations = 12;
  sparse.competitor = {
      .name = "ceres_sparse", .linear_solver = LinearSolver::kSparse, .num_threads = 2};
  sparse.timed = {Run({6e-3}, 0.1, 10.0)};
  sparse.converged = {Run({}, 0.1, 10.0)};
  iterative.competitor = {.name = "ceres_iterative", .linear_solver = LinearSolver::kIterative};
  iterative.timed = {Run({1e-3}, 0.1, 9.99)};
  iterative.timed[0].used_solver = "ITERATIVE_SCHUR (SCHUR_JACOBI)";
  iterative.converged = {Run({}, 0.1, 9.99)};
  dense.competitor = {.name = "ceres_dense_eigen", .linear_solver = LinearSolver::kDense};
  dense.skipped = "dense over 6000 unknowns";
  problem.results = {native, sparse, iterative, dense};
  result.problems = {problem};
  return result;
}

TEST(SolverBench, TakesTheLeastCostOfAll) { EXPECT_EQ(BestCost(MadeUpResult().problems[0]), 9.99); }

TEST(SolverBench, ScoresTheLeastMedianAndTheTimeToTheLeastCostOfAll) {
  const SolverBenchProblemResult problem = MadeUpResult().problems[0];
  const SolverScore score = ScoreOf(problem.results[0], 9.99);
  EXPECT_EQ(score.failure, "");
  EXPECT_DOUBLE_EQ(score.seconds_per_iteration.value(), 2e-3);
  EXPECT_DOUBLE_EQ(score.seconds_to_1_percent.value(), 0.31);  // 10.05 is less than 10.0899
  EXPECT_FALSE(score.seconds_to_01_percent) << "10 is more than 0.1 % above 9.99";
  EXPECT_DOUBLE_EQ(score.seconds_per_call.value(), 0.03);
  EXPECT_DOUBLE_EQ(ScoreOf(problem.results[0], 10.0).seconds_to_01_percent.value(), 0.71);
}

TEST(SolverBench, ShowsFailuresAndWhatWasSkipped) {
  SolverBenchResult result = MadeUpResult();
  result.problems[0].results[1].timed[0].failure = "ended by signal 9";
  EXPECT_EQ(ScoreOf(result.problems[0].results[3], 1.0).failure,
            "skipped: dense over 6000 unknowns");
  const std::string text = SolverTables(result).at(1).Markdown();
  EXPECT_THAT(text, HasSubstr("failed: ended by signal 9"));
  EXPECT_THAT(text, HasSubstr("skipped: dense over 6000 unknowns"));
}

TEST(SolverBench, TablesHoldFloorsRatiosCallsAndCovariances) {
  SolverBenchResult result = MadeUpResult();
  result.problems[0].results[0].covariances.seconds = {5e-3, 3e-3, 4e-3};
  result.problems[0].results[0].covariances.seconds_per_iteration = 2e-3;
  // The native solver reaches the least cost; its problem was built in half a second.
  for (SolverRun& run : result.problems[0].results[2].converged) run.final_cost = 10.0;
  for (SolverRun& run : result.problems[0].results[2].timed) run.final_cost = 10.0;
  ASSERT_EQ(BestCost(result.problems[0]), 10.0);
  const std::vector<Table> tables = SolverTables(result);
  ASSERT_THAT(tables, SizeIs(5));
  // 1e8 operations at 50 and 100 GFLOP/s.
  EXPECT_EQ(tables[0].rows[0][8], "2.00");
  EXPECT_EQ(tables[0].rows[0][9], "1.00");
  const auto& native = tables[1].rows[0];
  EXPECT_EQ(native[0], "native 1t");
  EXPECT_EQ(native[1], "2.00");
  EXPECT_EQ(native[2], "1.0");
  EXPECT_EQ(tables[1].rows[1][2], "6.0") << "two threads have the floor of two";
  EXPECT_EQ(tables[1].rows[2][2], "-") << "an inexact step has no floor";
  EXPECT_THAT(tables[2].Markdown(), HasSubstr("30.0 (4.00 iterations)"));
  EXPECT_EQ(tables[3].rows[0][1], "4.00 (2.0)");
  const auto& summary = tables[4].rows[0];
  EXPECT_EQ(summary[2], "2.00");
  EXPECT_EQ(summary[3], "6.00");
  EXPECT_EQ(summary[4], "3.0");
  EXPECT_EQ(summary[6], "1.00");
  EXPECT_EQ(summary[8], "1210 (native 1t)") << "0.71 s and what builds the problem";
}

TEST(SolverBench, JsonHoldsEveryRun) {
  const nlohmann::json json = SolverBenchToJson(MadeUpResult());
  const nlohmann::json& solvers = json["problems"][0]["solvers"];
  ASSERT_THAT(solvers, SizeIs(4));
  EXPECT_THAT(solvers[0]["timed"], SizeIs(2));
  EXPECT_EQ(solvers[0]["timed"][0]["log"][1][0], 0.2);
  EXPECT_EQ(solvers[3]["failure"], "skipped: dense over 6000 unknowns");
  EXPECT_EQ(json["problems"][0]["flops"]["total"], 1e8);
}

TEST(SolverBench, MeasuresAllCompetitorsOfASmallProblem) {
  SolverBenchOptions options;
  options.problems.names = {"ring_10"};
  options.problems.bundle[TermFamily::kPoint].loss = LossChoice::kTrivial;
  options.problems.bundle.refine_focal_length = options.problems.bundle.refine_extra_params = false;
  const std::vector<int> threads = {1};
  const std::vector<std::string> prefixes = {"ceres", "plain_ceres_sparse"};
  options.competitors = Competitors(threads, prefixes);
  options.repetitions = 2;
  options.iterations = 4;
  const SolverBenchResult result = BenchSolvers(options);
  ASSERT_THAT(result.problems, SizeIs(1));
  const SolverBenchProblemResult& problem = result.problems[0];
  EXPECT_EQ(problem.num_images, 10u);
  EXPECT_EQ(problem.num_features, 100u);
  EXPECT_EQ(problem.num_kept_unknowns, 53u);
  ASSERT_THAT(problem.results, SizeIs(5));
  const double best_cost = BestCost(problem);
  for (size_t i = 0; i < 4; ++i) {
    const SolverScore score = ScoreOf(problem.results[i], best_cost);
    EXPECT_EQ(score.failure, "") << problem.results[i].competitor.name;
    EXPECT_THAT(problem.results[i].timed, SizeIs(2));
    EXPECT_TRUE(score.seconds_per_iteration);
    EXPECT_TRUE(score.seconds_to_01_percent) << problem.results[i].competitor.name;
    EXPECT_NEAR(score.final_cost, best_cost, 1e-5 * best_cost);
  }
  EXPECT_EQ(problem.results[4].skipped, "BAL problems only");
  for (const Table& table : SolverTables(result)) EXPECT_FALSE(table.Markdown().empty());
}

}  // namespace
}  // namespace holba
