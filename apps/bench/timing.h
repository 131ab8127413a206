// SPDX-License-Identifier: BSD-3-Clause
// The benchmarks `scaling` and `wireframe` (the paper's runtime figures a and b): time of one
// iteration by size of the problem.
#pragma once

#include <string>
#include <vector>

#include "apps/bench/paper_bench.h"
#include "holba/bundle/bundle_options.h"
#include "holba/solver/solver.h"
#include "holba/synthetic/bundle_problem.h"

namespace holba {

// What is timed against each other.
struct TimingCase {
  std::string name;
  BundleOptions bundle;
};
// Point, Point-Line, Groups, Holistic.
std::vector<TimingCase> ConfigCases(const BundleOptions& bundle);
// Holistic with its wireframe in 2D and in 3D.
std::vector<TimingCase> WireframeFormCases(const BundleOptions& bundle);

// kCpu: of all threads of the process; with one thread what a quiet machine's wall clock would
// show, also on a busy one.
enum class TimingClock { kWall, kCpu };

struct TimingOptions {
  std::vector<int> num_images;
  std::vector<LinearSolver> linear_solvers;
  int iterations = 20;
  int repetitions = 3;
  double max_repeated_seconds = 60.0;  // a run that took longer is not repeated
  TimingClock clock = TimingClock::kWall;
  BundleProblemOptions scene;  // num_images apart
  SolverOptions solver;        // iterations, tolerances and linear solver apart
};

struct Timing {
  int num_images = 0;
  LinearSolver linear_solver = LinearSolver::kDense;
  std::string name;
  // Least over the repetitions of the median over the accepted iterations but the first.
  double seconds_per_iteration = 0.0;
  int iterations = 0;  // of one run
  std::string used_solver;
  ReducedSystem reduced_system;
  size_t num_residuals = 0;  // residual blocks
};

// Every case runs exactly options.iterations iterations with all tolerances 0 (one that has
// converged to the last bit before begins again), all cases of one size in turn, the turns
// repeated.
std::vector<Timing> TimeIterations(const TimingOptions& options,
                                   const std::vector<TimingCase>& cases);

// Of each seed in turn, from options.scene.seed on, what TimeIterations gave. Tables `NAME` (times,
// and the exponents of their growth where there are several sizes), `NAME_ratio` (times by those of
// the first case), `NAME_unknowns` and `NAME_density` (of the reduced system).
PaperBenchReport TimingReport(const std::string& name, const TimingOptions& options,
                              const std::vector<TimingCase>& cases,
                              const std::vector<std::vector<Timing>>& of_seeds);

}  // namespace holba
