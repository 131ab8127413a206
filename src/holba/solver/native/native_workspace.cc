// SPDX-License-Identifier: BSD-3-Clause
#include "holba/solver/native/native_workspace.h"

#include "holba/solver/native/linear_choice.h"

namespace holba {
namespace {

// From this number of unknowns on a factor in single precision is faster.
constexpr size_t kMinMixedUnknowns = 600;

native::SchurForm FormOf(const native::StepSolverChoice& choice) {
  if (choice.kind != LinearSolver::kIterative) return native::SchurForm::kExplicit;
  return choice.preconditioner == PreconditionerType::kBorder
             ? native::SchurForm::kImplicitWithBorder
             : native::SchurForm::kImplicit;
}

}  // namespace

void NativeWorkspace::Begin(const Problem& problem, const SolverOptions& options,
                            int num_threads) {
  Analyse(problem, num_threads);
  Choose(options, num_threads);
}

ReducedSolver* NativeWorkspace::BeginExplicit(const Problem& problem, int num_threads) {
  Analyse(problem, num_threads);
  SolverOptions options;
  options.linear_solver = chosen_;
  if (chosen_ != LinearSolver::kSparse && chosen_ != LinearSolver::kDense) {
    options.linear_solver = native::IsSparseFaster(equations_.FindPattern())
                                ? LinearSolver::kSparse
                                : LinearSolver::kDense;
  }
  // A mixed solver of the last solve serves as well: asked for the inverse, it makes its factor in
  // double.
  options.precision = made_for_.mixed ? FactorPrecision::kMixed : FactorPrecision::kDouble;
  Choose(options, num_threads);
  return step_solver_->Direct();
}

void NativeWorkspace::Analyse(const Problem& problem, int num_threads) {
  if (!equations_.Begin(problem, num_threads)) chosen_ = LinearSolver::kAuto;
}

void NativeWorkspace::Choose(const SolverOptions& options, int num_threads) {
  if (equations_.structure().num_nodes() == 0) {
    equations_.SetForm(native::SchurForm::kExplicit);
    step_solver_ = native::MakeEmptyStepSolver();
    made_for_ = {};
    return;
  }
  const native::StepSolverChoice choice = ChoiceFor(options, num_threads);
  if (step_solver_ != nullptr && choice == made_for_) {
    step_solver_->Reset();
    return;
  }
  step_solver_ = native::MakeStepSolver(choice, &equations_);
  made_for_ = choice;
}

// Also gives the equations the form of the choice.
native::StepSolverChoice NativeWorkspace::ChoiceFor(const SolverOptions& options,
                                                    int num_threads) {
  const native::Structure& structure = equations_.structure();
  native::StepSolverChoice choice;
  choice.kind = options.linear_solver;
  if (choice.kind == LinearSolver::kAuto) {
    if (chosen_ == LinearSolver::kAuto)
      chosen_ = native::ChooseLinearSolver(structure, equations_.FindPattern());
    choice.kind = chosen_;
  }
  const bool iterative = choice.kind == LinearSolver::kIterative;
  if (iterative) {
    choice.preconditioner = native::ChoosePreconditioner(options.preconditioner, structure);
    choice.eta = options.eta;
    choice.max_linear_solver_iterations = options.max_linear_solver_iterations;
  }
  equations_.SetForm(FormOf(choice));
  if (!iterative) {
    choice.mixed = options.precision == FactorPrecision::kMixed ||
                   (options.precision == FactorPrecision::kAuto &&
                    equations_.pattern().num_unknowns > kMinMixedUnknowns);
  }
  choice.num_threads = num_threads;
  choice.num_pose_nodes = structure.num_pose_nodes;
  choice.pattern_version = equations_.pattern_version();
  return choice;
}

}  // namespace holba
