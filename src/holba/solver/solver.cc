// SPDX-License-Identifier: BSD-3-Clause
#include "holba/solver/solver.h"

#include <algorithm>
#include <optional>
#include <utility>

#include "holba/base/check.h"
#include "holba/solver/backend.h"
#include "holba/solver/native/native_workspace.h"
#if HOLBA_WITH_PETSC
#include "holba/solver/petsc/petsc_backend.h"
#endif
#include "holba/solver/solve_journal.h"

namespace holba {

void SolverOptions::Describe(OptionTable* table) const {
  table->Section("Solver");
  std::vector<std::pair<std::string, Backend>> backends;
  for (const BackendEntry& entry : AllBackends()) backends.emplace_back(entry.name, entry.backend);
  table->Choice("backend", &backend, backends, "Which solver does the work.").Basic();
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
  table
      ->Field("num_threads", &num_threads, AtLeast(-1),
              "Threads; -1: one per hardware thread (Ceres itself: 1, since with more its sums "
              "change in the last digits).")
      .Basic();
  table
      ->Field("max_num_iterations", &max_num_iterations, AtLeast(0),
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
#if HOLBA_WITH_PETSC
PetscWorkspace& SolverWorkspace::Petsc() {
  if (petsc_ == nullptr) petsc_ = std::make_shared<PetscWorkspace>();
  return *petsc_;
}
#endif

SolverSummary Solve(const SolverOptions& options, Problem* problem, SolverWorkspace* workspace) {
  SolverWorkspace own;
  const auto backends = AllBackends();
  const auto entry = std::find_if(backends.begin(), backends.end(), [&](const BackendEntry& e) {
    return e.backend == options.backend;
  });
  HOLBA_CHECK_MSG(entry != backends.end(), "this build has no such backend");
  std::optional<SolverSummary> done;
  if (options.journal != nullptr) done = options.journal->Begin(problem);
  if (done) return std::move(*done);
  SolverSummary summary = entry->solve(options, problem, workspace ? workspace : &own);
  if (options.analyse_reduced_system) summary.reduced_system = AnalyseReducedSystem(*problem);
  // What was stopped from outside is not done.
  const bool finished =
      summary.stop_reason != StopReason::kCallback && summary.stop_reason != StopReason::kMaxTime;
  if (options.journal != nullptr && finished) options.journal->End(*problem, summary);
  return summary;
}

}  // namespace holba
