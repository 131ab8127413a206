// SPDX-License-Identifier: BSD-3-Clause
// Solvers of a Problem: Levenberg-Marquardt on the reduced system of the kept blocks.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "holba/base/options.h"
#include "holba/problem/problem.h"

namespace holba {

class NativeWorkspace;
class PetscWorkspace;
class SolveJournal;

// kPetsc: in all processes of a job together (docs/mpi.md), where the build has it.
enum class Backend { kNative, kCeres, kPetsc };
// How the reduced system is solved; automatic: native by the least predicted work, Ceres by the
// number of frames (COLMAP's bounds).
enum class LinearSolver { kAuto, kDense, kSparse, kIterative };
// kMixed: a factor in single precision, whose solutions are refined to double accuracy.
enum class FactorPrecision { kAuto, kDouble, kMixed };
// Preconditioner of the iterative solver. kBorder: the diagonal blocks of poses, and all of the
// border of groups and shared intrinsics with its couplings.
enum class PreconditionerType { kAuto, kBlockJacobi, kBorder, kPowerSeries };
// Dense library of Ceres; kAuto: LAPACK where the system is so large that it is faster.
enum class CeresDenseLibrary { kAuto, kEigen, kLapack };

struct IterationRecord {
  int iteration = 0;  // 0: the start
  bool accepted = true;
  double cost = 0.0;
  std::vector<TermCost> terms;  // at the last accepted state
  double cost_change = 0.0;
  double gradient_max_norm = 0.0;
  double step_norm = 0.0;
  double trust_radius = 0.0;  // the damping is its inverse
  double seconds = 0.0;       // this iteration
};

struct SolverOptions {
  Backend backend = Backend::kNative;
  LinearSolver linear_solver = LinearSolver::kAuto;
  FactorPrecision precision = FactorPrecision::kAuto;
  PreconditionerType preconditioner = PreconditionerType::kAuto;
  // Forcing term of the iterative solver (ConjugateGradientsOptions::eta).
  double eta = 0.1;
  CeresDenseLibrary ceres_dense_library = CeresDenseLibrary::kAuto;
  // Options of PETSc's solvers, as on its command line; of the backend petsc.
  std::string petsc_options;
  int num_threads = -1;
  int max_num_iterations = 100;
  int max_linear_solver_iterations = 200;
  double max_seconds = 1e9;
  double function_tolerance = 1e-6;
  double gradient_tolerance = 1e-10;
  double parameter_tolerance = 1e-8;
  double initial_trust_radius = 1e4;
  // Whether the angular terms count in the function tolerance.
  bool termination_counts_angular = false;

  // Whether the summary has all of reduced_system, or only its size.
  bool analyse_reduced_system = false;
  // Remembers solves that are done and the state of the one that is under way (solve_journal.h).
  SolveJournal* journal = nullptr;
  // Called after every iteration; return false to stop there.
  std::function<bool(const IterationRecord&)> on_iteration;

  void Describe(OptionTable* table) const;
};

enum class StopReason { kConverged, kMaxIterations, kMaxTime, kNoStep, kCallback, kNothingToDo };
std::string NameOf(StopReason reason);

// The part of one process in a solve that several of them share.
struct RankShare {
  double work = 0.0;  // predicted share of the work of an iteration, over the mean of all ranks
  size_t features = 0, residuals = 0;
  size_t kept_unknowns = 0;    // whose rows of the reduced system it owns
  size_t shared_unknowns = 0;  // of other ranks' rows that its features touch
  double messages_per_iteration = 0.0, bytes_per_iteration = 0.0;  // that it sends
  double peak_memory_mb = 0.0;                                     // of the whole process
};

struct SolverSummary {
  std::string backend;
  std::string linear_solver;  // the one that was used, with its library
  int num_threads = 1;
  StopReason stop_reason = StopReason::kNothingToDo;
  std::string message;
  int iterations = 0;  // steps tried
  int accepted_steps = 0;
  double initial_cost = 0.0, final_cost = 0.0;
  std::vector<TermCost> initial_terms, final_terms;
  // Ceres measures its linear solver as a whole: eliminate_seconds then has all of it, and
  // factorise_seconds and back_substitute_seconds are negative (unknown).
  double build_seconds = 0.0, linearise_seconds = 0.0, eliminate_seconds = 0.0,
         factorise_seconds = -1.0, back_substitute_seconds = -1.0, total_seconds = 0.0;
  std::vector<double> iteration_seconds;  // of each step tried
  ReducedSystem reduced_system;
  std::vector<RankShare> ranks;  // empty: one process has solved it alone

  double MedianIterationSeconds() const;
};

// Memory and analysis that one solve leaves for the next, for callers that solve many problems (the
// local adjustments of a mapper) or one problem many times. The analysis is used again if the next
// problem has the structure of the last one: the same blocks, roles, held coordinates and
// residuals, while values, measurements, losses and weights may differ. Results are the same bit
// for bit as without a workspace. One thread may use it at a time; Ceres ignores it.
class SolverWorkspace {
 public:
  SolverWorkspace();
  SolverWorkspace(SolverWorkspace&&) noexcept;
  SolverWorkspace& operator=(SolverWorkspace&&) noexcept;
  ~SolverWorkspace();

  NativeWorkspace& Native();  // of the native backend; made on first use
  PetscWorkspace& Petsc();    // of the backend petsc

 private:
  std::unique_ptr<NativeWorkspace> native_;
  std::shared_ptr<PetscWorkspace> petsc_;  // shared: its type is known where the build has it
};

// Minimises the cost from problem->state() on and leaves the best state found there.
SolverSummary Solve(const SolverOptions& options, Problem* problem,
                    SolverWorkspace* workspace = nullptr);

}  // namespace holba
