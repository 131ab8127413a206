// SPDX-License-Identifier: BSD-3-Clause
// Memory and analyses that one native solve leaves for the next.
#pragma once

#include <memory>

#include "holba/solver/native/normal_equations.h"
#include "holba/solver/native/step_solver.h"
#include "holba/solver/solver.h"

namespace holba {

class NativeWorkspace {
 public:
  // Analyses the problem, and chooses the form of its reduced system and the solver that the
  // options ask for.
  void Begin(const Problem& problem, const SolverOptions& options, int num_threads);
  // The same for the explicit form and a direct solver of it. Null: no block is kept.
  ReducedSolver* BeginExplicit(const Problem& problem, int num_threads);

  native::NormalEquations& equations() { return equations_; }
  native::StepSolver& step_solver() { return *step_solver_; }

 private:
  void Analyse(const Problem& problem, int num_threads);
  void Choose(const SolverOptions& options, int num_threads);
  native::StepSolverChoice ChoiceFor(const SolverOptions& options, int num_threads);

  native::NormalEquations equations_;
  std::unique_ptr<native::StepSolver> step_solver_;
  native::StepSolverChoice made_for_;  // of step_solver_
  // What ChooseLinearSolver said about this structure; kAuto: it was not asked.
  LinearSolver chosen_ = LinearSolver::kAuto;
};

}  // namespace holba
