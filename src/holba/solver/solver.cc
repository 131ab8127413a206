// SPDX-License-Identifier: BSD-3-Clause
#include "holba/solver/solver.h"

#include <algorithm>

#include "holba/base/check.h"
#if HOLBA_WITH_CERES
#include "holba/solver/ceres/ceres_backend.h"
#endif
#include "holba/solver/native/native_backend.h"

namespace holba {

void SolverOptions::Describe(OptionTable* table) const {
  table->Section("Solver");
  table->Choice("backend", &backend,
                {
                  {"native", Backend::kNative},
#if HOLBA_WITH_CERES
                      {"ceres", Backend::kCeres},
#endif
                },
                "Which solver does the work.")
      .Basic();
  table->Choice("linear_solver", &linear_solver,
                {{"auto", LinearSolver::kAuto},
                 {"dense", LinearSolver::kDense},
                 {"sparse", LinearSolver::kSparse},
                 {"iterative", LinearSolver::kIterative}},
                "How the reduced system is solved; auto: whichever has the least predicted work "
                "(Ceres: dense up to 50 frames, sparse up to 1000, then iterative).");
  table->Choice("precision", &precision,
                {{"auto", FactorPrecision::kAuto},
                 {"double", FactorPrecision::kDouble},
                 {"mixed", FactorPrecision::kMixed}},
                "Of the native solver's factor; mixed: single precision, solutions refined to "
                "double accuracy; auto: mixed where that is faster.");
  table->Choice("preconditioner", &preconditioner,
                {{"auto", PreconditionerType::kAuto},
                 {"block_jacobi", PreconditionerType::kBlockJacobi},
                 {"border", PreconditionerType::kBorder},
                 {"power_series", PreconditionerType::kPowerSeries}},
                "Of the native iterative solver; border: groups and shared intrinsics exactly, "
                "beside the poses' blocks; auto: border where these are few.");
  table->Field("eta", &eta, Between(1e-12, 1.0),
               "How inexact a step of the iterative solver may be (forcing term).");
  table->Choice("ceres_dense_library", &ceres_dense_library,
                {{"auto", CeresDenseLibrary::kAuto},
                 {"eigen", CeresDenseLibrary::kEigen},
                 {"lapack", CeresDenseLibrary::kLapack}},
                "Factorisation of the backend ceres with a dense reduced system; auto: LAPACK from "
                "600 unknowns on.");
  table->Field("num_threads", &num_threads, AtLeast(-1),
               "Threads; -1: one per hardware thread (Ceres itself: 1, since with more its sums "
               "change in the last digits).")
      .Basic();
  table->Field("max_num_iterations", &max_num_iterations, AtLeast(0),
               "Most iterations of one round (losses auto and the gate take several).")
      .Basic();
  table->Field("max_linear_solver_iterations", &max_linear_solver_iterations, AtLeast(1),
               "Most conjugate gradient steps of the iterative solver in one iteration.");
  table->Field("max_seconds", &max_seconds, GreaterThan(0),
               "Most wall time of one adjustment, seconds.");
  table->Field("function_tolerance", &function_tolerance, AtLeast(0),
               "Converged when the cost of the terms in pixels changes less than this share of "
               "itself; 0: off.");
  table->Field("gradient_tolerance", &gradient_tolerance, AtLeast(0),
               "Converged when no entry of the gradient is larger (COLMAP: 1e-4); 0: off.");
  table->Field("parameter_tolerance", &parameter_tolerance, AtLeast(0),
               "Converged when the step is shorter than this share of the state; 0: off.");
  table->Field("initial_trust_radius", &initial_trust_radius, GreaterThan(0),
               "Trust region radius of the first step; the damping is its inverse.");
  table->Field("termination_counts_angular", &termination_counts_angular,
               "Whether angular terms count in function_tolerance (the paper leaves them out).");
}

std::string NameOf(StopReason reason) {
  switch (reason) {
    case StopReason::kConverged:
      return "converged";
    case StopReason::kMaxIterations:
      return "max_num_iterations";
    case StopReason::kMaxTime:
      return "max_seconds";
    case StopReason::kNoStep:
      return "no_step_improves";
    case StopReason::kCallback:
      return "stopped_by_caller";
    case StopReason::kNothingToDo:
      return "nothing_to_adjust";
  }
  return "";
}

double SolverSummary::MedianIterationSeconds() const {
  if (iteration_seconds.empty()) return 0.0;
  std::vector<double> sorted = iteration_seconds;
  const size_t middle = sorted.size() / 2;
  std::nth_element(sorted.begin(), sorted.begin() + middle, sorted.end());
  return sorted[middle];
}

SolverWorkspace::SolverWorkspace() = default;
SolverWorkspace::SolverWorkspace(SolverWorkspace&&) noexcept = default;
SolverWorkspace& SolverWorkspace::operator=(SolverWorkspace&&) noexcept = default;
SolverWorkspace::~SolverWorkspace() = default;
NativeWorkspace& SolverWorkspace::Native() {
  if (native_ == nullptr) native_ = std::make_unique<NativeWorkspace>();
  return *native_;
}

SolverSummary Solve(const SolverOptions& options, Problem* problem, SolverWorkspace* workspace) {
  SolverSummary summary;
  switch (options.backend) {
    case Backend::kNative: {
      SolverWorkspace own;
      summary = SolveNatively(options, problem, &(workspace ? workspace : &own)->Native());
      break;
    }
    case Backend::kCeres:
#if HOLBA_WITH_CERES
      summary = SolveWithCeres(options, problem);
#else
      HOLBA_CHECK_MSG(false, "this build has no Ceres (HOLBA_WITH_CERES)");
#endif
      break;
  }
  if (options.analyse_reduced_system) summary.reduced_system = AnalyseReducedSystem(*problem);
  return summary;
}

}  // namespace holba
