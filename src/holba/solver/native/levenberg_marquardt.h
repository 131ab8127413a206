// SPDX-License-Identifier: BSD-3-Clause
// The loop of Levenberg-Marquardt: damping, acceptance of steps, termination and the record of it.
// One loop for every backend that eliminates features with NormalEquations, in one process or in
// many.
#pragma once

#include "holba/problem/problem.h"
#include "holba/solver/native/normal_equations.h"
#include "holba/solver/native/solve_log.h"
#include "holba/solver/solver.h"

namespace holba::native {

// A problem and its state as the loop sees them. Where several processes run the loop on one
// problem, each call is made by all of them, and all get the same numbers.
class LinearisedProblem {
 public:
  virtual ~LinearisedProblem() = default;

  virtual bool IsEmpty() const = 0;  // no block is variable
  // At the current state, with damping 1 / radius.
  virtual void Linearise(double radius, Linearisation* out) = 0;
  // The step of the kept unknowns; false: there is none at this damping.
  virtual bool SolveKept() = 0;
  // The step of the features that belongs to it, and the cost where both lead.
  virtual void Step(Trial* out) = 0;
  // Makes that state the current one.
  virtual void Accept() = 0;
  // For the journal: the state that Accept left, and what residuals were; and back. The rest of
  // `loop` stays.
  virtual void Save(LoopState* loop) = 0;
  virtual void Restore(const LoopState& loop) = 0;
  // What one process says to a question that clocks and callers answer; all go on with it.
  virtual bool Agree(bool mine) { return mine; }
};

// Minimises from the current state on. `problem` says what the batches are.
SolverSummary Minimise(const SolverOptions& options, const Problem& problem,
                       LinearisedProblem* system, SolveLog* log);

}  // namespace holba::native
