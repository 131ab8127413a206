// SPDX-License-Identifier: BSD-3-Clause
#include "holba/solver/native/solve_log.h"

#include <algorithm>

#include "holba/base/threads.h"

namespace holba::native {

SolveLog::SolveLog(const std::string& backend, const SolverOptions& options, const Problem& problem)
    : options_(options), problem_(problem) {
  summary_.backend = backend;
  summary_.num_threads = NumThreads(options.num_threads);
  summary_.factorise_seconds = summary_.back_substitute_seconds = 0.0;
}

void SolveLog::EndBuild(const std::string& linear_solver) {
  summary_.linear_solver = linear_solver;
  summary_.reduced_system.size = NumKeptUnknowns(problem_);
  summary_.build_seconds = timer_.Seconds();
}

void SolveLog::AddLinearisation(double seconds, const Linearisation& linearisation) {
  summary_.linearise_seconds += linearisation.evaluation_share * seconds;
  summary_.eliminate_seconds += (1.0 - linearisation.evaluation_share) * seconds;
}

void SolveLog::BeginIteration() { iteration_timer_ = Timer(); }

void SolveLog::SetStart(const StateCost& start) {
  summary_.initial_terms = TermsOf(start);
  summary_.initial_cost = record_.cost = start.total;
}

void SolveLog::AddStep(bool accepted, double cost_change, double step_norm) {
  record_.iteration = ++summary_.iterations;
  summary_.accepted_steps += accepted;
  record_.accepted = accepted;
  record_.cost_change = cost_change;
  record_.step_norm = step_norm;
}

bool SolveLog::EndIteration(const Linearisation& linearisation, double radius) {
  record_.seconds = iteration_timer_.Seconds();
  record_.trust_radius = radius;
  record_.gradient_max_norm = linearisation.max_gradient;
  if (record_.iteration > 0) summary_.iteration_seconds.push_back(record_.seconds);
  if (!options_.on_iteration) return true;
  record_.terms = TermsOf(linearisation.cost);
  return options_.on_iteration(record_);
}

void SolveLog::Save(LoopState* loop) const {
  loop->summary = summary_;
  loop->cost = record_.cost;
}
void SolveLog::Restore(const LoopState& loop) {
  const std::string linear_solver = summary_.linear_solver;
  const int num_threads = summary_.num_threads;
  summary_ = loop.summary;
  summary_.linear_solver = linear_solver;
  summary_.num_threads = num_threads;
  record_.iteration = summary_.iterations;
  record_.cost = loop.cost;
}

SolverSummary SolveLog::Finish(const StateCost& end, const Stop& stop) {
  summary_.stop_reason = stop.reason;
  summary_.message = stop.message;
  summary_.final_terms = TermsOf(end);
  summary_.final_cost = end.total;
  summary_.total_seconds = timer_.Seconds();
  return std::move(summary_);
}

// Costs by batch, added up by term.
std::vector<TermCost> SolveLog::TermsOf(const StateCost& cost) const {
  std::vector<TermCost> terms;
  for (size_t b = 0; b < problem_.batches().size(); ++b) {
    const ResidualBatch& batch = *problem_.batches()[b];
    auto it = std::find_if(terms.begin(), terms.end(),
                           [&](const TermCost& t) { return t.term == batch.term(); });
    if (it == terms.end()) it = terms.insert(it, TermCost{batch.term(), batch.angular});
    it->residuals += cost.batches[b].residuals;
    it->absent += cost.batches[b].absent;
    it->sum_squares += cost.batches[b].sum_squares;
    it->cost += cost.batches[b].cost;
  }
  return terms;
}

}  // namespace holba::native
