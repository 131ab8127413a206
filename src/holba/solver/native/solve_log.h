// SPDX-License-Identifier: BSD-3-Clause
// Statistics of a native solve: times, costs by term, and the records that callers get.
#pragma once

#include <string>
#include <vector>

#include "holba/base/timer.h"
#include "holba/solver/native/normal_equations.h"
#include "holba/solver/solver.h"

namespace holba::native {

struct Stop {
  StopReason reason;
  std::string message;
};

class SolveLog {
 public:
  SolveLog(const std::string& backend, const SolverOptions& options, const Problem& problem);

  int num_threads() const { return summary_.num_threads; }
  int iterations() const { return summary_.iterations; }
  double Seconds() const { return timer_.Seconds(); }

  // The end of the analysis.
  void EndBuild(const std::string& linear_solver);
  void AddLinearisation(double seconds, const Linearisation& linearisation);
  void AddFactorisation(double seconds) { summary_.factorise_seconds += seconds; }
  void AddBackSubstitution(double seconds) { summary_.back_substitute_seconds += seconds; }

  // Iteration 0 is the linearisation at the start; it has no step.
  void BeginIteration();
  void SetStart(const StateCost& start);
  // A step was found, or none (cost_change and step_norm are 0).
  void AddStep(bool accepted, double cost_change, double step_norm);
  // Cost at the accepted state.
  void SetCost(const StateCost& cost) { record_.cost = cost.total; }
  // False: the caller wants to stop here.
  bool EndIteration(const Linearisation& linearisation, double radius);

  // For the journal.
  void Save(LoopState* loop) const;
  void Restore(const LoopState& loop);

  SolverSummary Finish(const StateCost& end, const Stop& stop);

 private:
  std::vector<TermCost> TermsOf(const StateCost& cost) const;

  const SolverOptions& options_;
  const Problem& problem_;
  SolverSummary summary_;
  IterationRecord record_;
  Timer timer_, iteration_timer_;
};

}  // namespace holba::native
