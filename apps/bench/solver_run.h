// SPDX-License-Identifier: BSD-3-Clause
// One solver on one problem, in a process of its own: what the benchmark `solver` measures.
#pragma once

#include <functional>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "apps/bench/solver_problems.h"
#include "holba/solver/solver.h"

namespace holba {

// A way to solve. kPlainCeres: plain_ceres.h, for BAL problems only.
enum class SolverProgram { kHolba, kPlainCeres };
struct Competitor {
  std::string name;  // "native", "ceres_dense_lapack", "plain_ceres_sparse", ...
  SolverProgram program = SolverProgram::kHolba;
  Backend backend = Backend::kCeres;
  LinearSolver linear_solver = LinearSolver::kAuto;
  CeresDenseLibrary dense_library = CeresDenseLibrary::kAuto;
  int num_threads = 1;

  bool IsNative() const { return program == SolverProgram::kHolba && backend == Backend::kNative; }
};
// The list of them all, each for every number of threads, or those whose names begin with one of
// `prefixes`. Throws InputError for a prefix that fits none.
std::vector<Competitor> Competitors(std::span<const int> num_threads,
                                    std::span<const std::string> prefixes);

// Why a competitor is not run on a problem; empty: it is. The rule, so that hopeless cases do not
// take hours: plain Ceres programs are for BAL problems; dense systems up to 6000 unknowns (1000
// images), factorised by Eigen up to 3000.
std::string WhySkipped(const Competitor& competitor, bool is_bal, size_t num_kept_unknowns);

enum class RunMode {
  kTimed,        // exactly `iterations` iterations with all tolerances 0
  kConverged,    // until the cost changes by less than function_tolerance
  kCovariances,  // of all blocks, the gauge fixed, after some iterations; native only
  kCalls  // `calls` adjustments in a row, each of a problem built anew and a little different
};
struct RunOptions {
  RunMode mode = RunMode::kTimed;
  int iterations = 20;
  int calls = 200;
  double max_seconds = 120.0;  // of the solver; it stops after the iteration that passes this
  SolverOptions solver;        // what the competitor and the mode leave open
};

struct LoggedIteration {
  double seconds = 0.0;
  double cost = 0.0;
  bool accepted = true;
};

struct SolverRun {
  std::string failure;  // why there is no result; empty: there is one
  std::string used_solver, stop_reason;
  double build_problem_seconds = 0.0;  // BuildProblem
  double build_seconds = 0.0;          // what the solver builds from the problem
  double total_seconds = 0.0;          // of the solver
  double peak_memory_mb = 0.0;         // above what was resident when the solver was called
  double initial_cost = 0.0, final_cost = 0.0;
  int num_iterations = 0;  // over all solves of the run
  double linearise_seconds = 0.0, eliminate_seconds = 0.0;
  double factorise_seconds = -1.0, back_substitute_seconds = -1.0;  // -1: not known
  std::vector<LoggedIteration> log;                                 // of the first solve
  std::vector<double> seconds;  // kTimed: of accepted iterations but the first of a solve; kCalls:
                                // of calls, building included; kCovariances: of computing them
  double seconds_per_iteration = 0.0;  // kCovariances: of the iterations before
};

// Whether a solver, by the name that it gave in SolverRun::used_solver, solves the reduced system
// as far as rounding allows; conjugate gradients on it do not.
bool TakesExactSteps(std::string_view used_solver);

// In this process.
SolverRun RunSolver(const SolverProblem& problem, const Competitor& competitor,
                    const RunOptions& options);
// In a child process, so that memory is its own and a crash no more than a failed run;
// `max_seconds` is the longest it may take before it is ended.
SolverRun RunInChild(const std::function<SolverRun()>& run, double max_seconds);

// Seconds from the beginning of the build until an accepted iteration has a cost of at most
// `target`. Empty: none has.
std::optional<double> TimeToCost(double build_seconds, std::span<const LoggedIteration> log,
                                 double target);

}  // namespace holba
