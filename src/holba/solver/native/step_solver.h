// SPDX-License-Identifier: BSD-3-Clause
// The step of the kept unknowns: a solver of the reduced system, chosen once per problem.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include "holba/linear/reduced_solver.h"
#include "holba/solver/native/normal_equations.h"
#include "holba/solver/solver.h"

namespace holba::native {

class StepSolver {
 public:
  virtual ~StepSolver() = default;
  // The step of the kept unknowns; false: there is none at this damping.
  virtual bool Solve(NormalEquations* equations, std::span<double> step) = 0;
  // The direct solver; null: this is none.
  virtual ReducedSolver* Direct() { return nullptr; }
  // To be called before another problem of the same pattern.
  virtual void Reset() {}
  virtual std::string Name() const = 0;
};

// All that the making of a step solver depends on: problems with equal choices share one.
struct StepSolverChoice {
  LinearSolver kind = LinearSolver::kAuto;
  bool mixed = false;  // a factor in single precision
  PreconditionerType preconditioner = PreconditionerType::kAuto;
  double eta = 0.0;
  int max_linear_solver_iterations = 0;
  int num_threads = 0;
  uint32_t num_pose_nodes = 0;
  uint64_t pattern_version = 0;

  bool operator==(const StepSolverChoice&) const = default;
};

// What kAuto stands for.
PreconditionerType ChoosePreconditioner(PreconditionerType wanted, const Structure& structure);

// `equations` have the form that belongs to the choice, and must outlive the solver.
std::unique_ptr<StepSolver> MakeStepSolver(const StepSolverChoice& choice,
                                           NormalEquations* equations);

// For problems without kept unknowns: there is no reduced system.
std::unique_ptr<StepSolver> MakeEmptyStepSolver();

}  // namespace holba::native
