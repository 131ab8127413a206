// SPDX-License-Identifier: BSD-3-Clause
// The benchmark `solver`: holba's own solver against Ceres, problem by problem.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "apps/bench/solver_floor.h"
#include "apps/bench/solver_problems.h"
#include "apps/bench/solver_run.h"
#include "apps/bench/table.h"

namespace holba {

struct SolverBenchOptions {
  SolverProblemOptions problems;
  std::vector<Competitor> competitors;
  int iterations = 20;
  int repetitions = 3;
  double max_repeated_seconds = 60.0;  // a run that took longer is not repeated
  double max_run_seconds = 120.0;      // a solver stops after the iteration that passes this
  int calls = 200;
  double quality_function_tolerance = 1e-9;
  int quality_iterations = 50;  // at most, of the converging runs
  int call_iterations = 25;     // at most, of one call: COLMAP's bound on local adjustments
  SolverOptions solver;
};

// What one competitor did on one problem.
struct SolverResult {
  Competitor competitor;
  std::string skipped;  // why it was not run
  std::vector<SolverRun> timed, converged;
  SolverRun calls;        // of local problems
  SolverRun covariances;  // native, automatic linear solver
};

struct SolverBenchProblemResult {
  std::string name;
  bool is_local = false;
  size_t num_images = 0, num_features = 0, num_residuals = 0, num_kept_unknowns = 0;
  double density = 0.0;  // of the reduced system
  IterationFlops flops;
  std::vector<SolverResult> results;  // in the order of the competitors
};

struct SolverBenchResult {
  // Of one thread and of the most threads that a competitor has.
  double peak_gflops_one = 0.0, peak_gflops_all = 0.0;
  int all_threads = 1;
  std::vector<SolverBenchProblemResult> problems;
};

// Every run in a child process; all competitors in turn, the turns repeated.
SolverBenchResult BenchSolvers(const SolverBenchOptions& options);

// What the tables say of a competitor; empty where there is nothing to say.
struct SolverScore {
  std::string failure;  // why there are no numbers, of a run that was tried or of one that was not
  std::optional<double> seconds_per_iteration;  // least median over the repetitions
  std::optional<double> seconds_to_1_percent, seconds_to_01_percent;  // median over repetitions
  std::optional<double> seconds_per_call;                             // median over the calls
  double build_problem_seconds = 0.0;                                 // median over repetitions
  double peak_memory_mb = 0.0;                                        // largest
  double initial_cost = 0.0, final_cost = 0.0;
  int iterations = 0;     // of the converging run
  bool is_exact = false;  // TakesExactSteps
};
// `best_cost`: the least final cost of all on this problem.
SolverScore ScoreOf(const SolverResult& result, double best_cost);
double BestCost(const SolverBenchProblemResult& problem);

// Problems; one table for each problem; calls; covariances; last a summary with the ratios of the
// best of Ceres to the best of the native solver.
std::vector<Table> SolverTables(const SolverBenchResult& result);
nlohmann::json SolverBenchToJson(const SolverBenchResult& result);

}  // namespace holba
