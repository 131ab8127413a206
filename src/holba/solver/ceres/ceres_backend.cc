// SPDX-License-Identifier: BSD-3-Clause
#include "holba/solver/ceres/ceres_backend.h"

#include <ceres/ceres.h>
#include <glog/logging.h>

#include <algorithm>
#include <cmath>
#include <deque>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "holba/base/threads.h"
#include "holba/base/timer.h"
#include "holba/solver/ceres/ceres_adapters.h"

namespace holba {
namespace {

// COLMAP's bounds on the number of frames.
constexpr size_t kMaxFramesDense = 50;
constexpr size_t kMaxFramesSparse = 1000;
// From here LAPACK's blocked factorisation beats Eigen's.
constexpr size_t kMinSizeLapack = 600;

// The problem as Ceres has it, and all that must exist as long.
struct CeresProblem {
  ceres::Problem problem;
  std::vector<std::unique_ptr<ceres::Manifold>> manifolds;
  std::vector<std::unique_ptr<ceres::LossFunction>> losses;
  std::deque<CeresResidual> residuals;   // in the order in which Ceres evaluates them
  std::vector<ResidualMemory> memories;  // by batch
  size_t num_variable_frames = 0;
  size_t num_kept_unknowns = 0;

  CeresProblem() : problem(Options()) {}
  static ceres::Problem::Options Options() {
    ceres::Problem::Options options;
    options.cost_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
    options.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
    options.manifold_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
    options.disable_all_safety_checks = true;
    return options;
  }
};

// Evaluates one residual at the problem's state into its memory; a residual that is absent there
// keeps its last value.
void Remember(const ResidualBatch& batch, size_t i, const ParameterReader& reader,
              ResidualMemory* memory) {
  double residual[kMaxResidualDim];
  bool present = false;
  ResidualPanel panel;
  panel.residuals = residual;
  panel.present = &present;
  batch.Evaluate(i, i + 1, reader, panel);
  memory->present[i] = present;
  if (!present) return;
  std::copy_n(residual, batch.dim(), &memory->values[i * batch.dim()]);
  memory->known[i] = 1;
}

// Hands a problem to Ceres: the blocks that its residuals hold, in elimination groups, and the
// residuals with a variable block. Ceres never sees the others, so they are evaluated here, once;
// CeresResidual remembers the rest whenever Ceres asks for Jacobians, which it does at the start
// and at every accepted state.
class CeresBuilder {
 public:
  CeresBuilder(Problem* problem, CeresProblem* out, ceres::ParameterBlockOrdering* ordering)
      : problem_(*problem), out_(*out), ordering_(*ordering), added_(problem->num_blocks(), 0) {
    out_.memories.resize(problem_.batches().size());
    for (size_t b = 0; b < problem_.batches().size(); ++b)
      AddBatch(*problem_.batches()[b], &out_.memories[b]);
  }

 private:
  void AddBatch(const ResidualBatch& batch, ResidualMemory* memory) {
    out_.losses.push_back(std::make_unique<CeresLoss>(batch.loss, batch.weight));
    ceres::LossFunction* loss = out_.losses.back().get();
    if (batch.loss.type == LossType::kTrivial && batch.weight == 1.0) loss = nullptr;
    memory->Resize(batch.size(), batch.dim());
    std::vector<double*> parameters(batch.num_slots());
    for (size_t i = 0; i < batch.size(); ++i) {
      bool variable = false;
      for (int s = 0; s < batch.num_slots(); ++s)
        variable |= problem_.block(batch.block(i, s)).IsVariable();
      if (!variable) {
        Remember(batch, i, problem_.Reader(), memory);
        continue;
      }
      for (int s = 0; s < batch.num_slots(); ++s) {
        AddBlock(batch.block(i, s));
        parameters[s] = problem_.values(batch.block(i, s));
      }
      out_.residuals.emplace_back(problem_, batch, i, memory);
      out_.problem.AddResidualBlock(&out_.residuals.back(), loss, parameters);
    }
  }

  void AddBlock(BlockId id) {
    if (added_[id]) return;
    added_[id] = 1;
    const ParameterBlock& block = problem_.block(id);
    const ManifoldOps& ops = *block.manifold;
    double* values = problem_.values(id);
    out_.problem.AddParameterBlock(values, ops.ambient);
    if (!block.IsVariable()) {
      out_.problem.SetParameterBlockConstant(values);
      return;
    }
    if (ops.ambient != ops.tangent || block.held) {
      ceres::Manifold*& manifold = manifolds_[{&ops, block.held}];
      if (!manifold) {
        out_.manifolds.push_back(std::make_unique<CeresManifold>(ops, block.held));
        manifold = out_.manifolds.back().get();
      }
      out_.problem.SetManifold(values, manifold);
    }
    ordering_.AddElementToGroup(values, IsKept(block.role) ? 1 : 0);
    out_.num_variable_frames += block.role == BlockRole::kPose;
    if (IsKept(block.role)) out_.num_kept_unknowns += block.FreeTangent();
  }

  Problem& problem_;
  CeresProblem& out_;
  ceres::ParameterBlockOrdering& ordering_;
  std::vector<uint8_t> added_;  // by block
  std::map<std::pair<const ManifoldOps*, uint32_t>, ceres::Manifold*> manifolds_;
};

// Costs per term from the remembered residuals of the last accepted state; what is absent there
// counts with the value that it had.
std::vector<TermCost> TermsFromMemory(const Problem& problem,
                                      const std::vector<ResidualMemory>& memories) {
  std::vector<TermCost> terms;
  for (size_t b = 0; b < problem.batches().size(); ++b) {
    const ResidualBatch& batch = *problem.batches()[b];
    auto it = std::find_if(terms.begin(), terms.end(),
                           [&](const TermCost& t) { return t.term == batch.term(); });
    if (it == terms.end()) it = terms.insert(it, TermCost{batch.term(), batch.angular});
    for (size_t i = 0; i < batch.size(); ++i) {
      ++it->residuals;
      it->absent += !memories[b].present[i];
      if (!memories[b].known[i]) continue;
      double s = 0.0;
      for (int k = 0; k < batch.dim(); ++k) {
        const double r = memories[b].values[i * batch.dim() + k];
        s += r * r;
      }
      it->sum_squares += s;
      it->cost += 0.5 * batch.weight * batch.loss.Cost(s);
    }
  }
  return terms;
}

// The paper's termination: relative change of the cost without the angular terms.
class IterationWatch final : public ceres::IterationCallback {
 public:
  IterationWatch(const SolverOptions& options, const Problem& problem,
                 const std::vector<ResidualMemory>& memories, SolverSummary* summary)
      : options_(options), problem_(problem), memories_(memories), summary_(summary) {
    for (const auto& batch : problem.batches()) {
      watches_terms_ |= batch->angular && !options.termination_counts_angular;
    }
  }

  ceres::CallbackReturnType operator()(const ceres::IterationSummary& it) override {
    if (it.iteration == 0) Start(it);
    const IterationRecord record = RecordOf(it);
    if (record.accepted) best_state_ = problem_.state();
    if (it.iteration > 0) {
      summary_->iteration_seconds.push_back(record.seconds);
      summary_->accepted_steps += record.accepted;
    }
    // A caller's wish ends in success, too: an abort would lose the best state.
    if (options_.on_iteration && !options_.on_iteration(record)) {
      summary_->stop_reason = StopReason::kCallback;
      return ceres::SOLVER_TERMINATE_SUCCESSFULLY;
    }
    const double before = watched_;
    watched_ = WatchedCost(record);
    const bool converged = it.iteration > 0 && record.accepted &&
                           std::abs(before - watched_) <= options_.function_tolerance * before;
    if (!converged) return ceres::SOLVER_CONTINUE;
    summary_->stop_reason = StopReason::kConverged;
    summary_->message = "the cost of the terms in pixels changes less than function_tolerance";
    return ceres::SOLVER_TERMINATE_SUCCESSFULLY;
  }

  // The last accepted state; Ceres itself goes back to the start when it fails.
  const std::vector<double>& best_state() const { return best_state_; }
  // Whether Ceres came as far as to evaluate the start.
  bool was_called() const { return was_called_; }

 private:
  void Start(const ceres::IterationSummary& it) {
    was_called_ = true;
    summary_->stop_reason = StopReason::kMaxIterations;
    summary_->initial_terms = TermsFromMemory(problem_, memories_);
    constant_cost_ = -it.cost;
    for (const TermCost& term : summary_->initial_terms) constant_cost_ += term.cost;
  }

  IterationRecord RecordOf(const ceres::IterationSummary& it) const {
    IterationRecord record;
    record.iteration = it.iteration;
    record.accepted = it.iteration == 0 || it.step_is_successful;
    record.cost = it.cost;
    record.cost_change = it.cost_change;
    record.gradient_max_norm = it.gradient_max_norm;
    record.step_norm = it.step_norm;
    record.trust_radius = it.trust_region_radius;
    record.seconds = it.iteration_time_in_seconds;
    if (options_.on_iteration || watches_terms_)
      record.terms = TermsFromMemory(problem_, memories_);
    return record;
  }

  // Cost of the terms that function_tolerance looks at.
  double WatchedCost(const IterationRecord& record) const {
    if (!watches_terms_) return record.cost + constant_cost_;
    double cost = 0.0;
    for (const TermCost& term : record.terms) cost += term.angular ? 0.0 : term.cost;
    return cost;
  }

  const SolverOptions& options_;
  const Problem& problem_;
  const std::vector<ResidualMemory>& memories_;
  SolverSummary* summary_;
  std::vector<double> best_state_;
  bool watches_terms_ = false;  // WatchedCost leaves out the angular terms
  bool was_called_ = false;
  double watched_ = 0.0;
  double constant_cost_ = 0.0;  // of the residuals that Ceres does not see
};

LinearSolver ChooseLinearSolver(LinearSolver wanted, size_t num_frames) {
  if (wanted != LinearSolver::kAuto) return wanted;
  if (num_frames <= kMaxFramesDense) return LinearSolver::kDense;
  return num_frames <= kMaxFramesSparse ? LinearSolver::kSparse : LinearSolver::kIterative;
}

// Sets the linear solver and its libraries; returns their name.
std::string SetLinearSolver(const SolverOptions& options, const CeresProblem& problem,
                            ceres::Solver::Options* out) {
  switch (ChooseLinearSolver(options.linear_solver, problem.num_variable_frames)) {
    case LinearSolver::kAuto:
    case LinearSolver::kDense: {
      const bool wanted = options.ceres_dense_library == CeresDenseLibrary::kAuto
                              ? problem.num_kept_unknowns >= kMinSizeLapack
                              : options.ceres_dense_library == CeresDenseLibrary::kLapack;
      const bool lapack = wanted && ceres::IsDenseLinearAlgebraLibraryTypeAvailable(ceres::LAPACK);
      out->linear_solver_type = ceres::DENSE_SCHUR;
      out->dense_linear_algebra_library_type = lapack ? ceres::LAPACK : ceres::EIGEN;
      return lapack ? "DENSE_SCHUR (LAPACK)" : "DENSE_SCHUR (Eigen)";
    }
    case LinearSolver::kSparse: {
      out->linear_solver_type = ceres::SPARSE_SCHUR;
      const bool suite_sparse =
          ceres::IsSparseLinearAlgebraLibraryTypeAvailable(ceres::SUITE_SPARSE);
      out->sparse_linear_algebra_library_type =
          suite_sparse ? ceres::SUITE_SPARSE : ceres::EIGEN_SPARSE;
      return suite_sparse ? "SPARSE_SCHUR (SuiteSparse)" : "SPARSE_SCHUR (Eigen)";
    }
    case LinearSolver::kIterative:
      out->linear_solver_type = ceres::ITERATIVE_SCHUR;
      out->preconditioner_type = ceres::SCHUR_JACOBI;
      return "ITERATIVE_SCHUR (SCHUR_JACOBI)";
  }
  return "";
}

// A Schur solver needs features and kept blocks; with only one of them there is nothing to
// eliminate from. Returns the name of the solver.
std::string SetOrdering(const std::shared_ptr<ceres::ParameterBlockOrdering>& ordering,
                        const std::string& schur_solver, ceres::Solver::Options* out) {
  if (ordering->NumGroups() == 2) {
    out->linear_solver_ordering = ordering;
    return schur_solver;
  }
  if (out->linear_solver_type == ceres::DENSE_SCHUR && ordering->GroupSize(1) > 0) {
    out->linear_solver_type = ceres::DENSE_NORMAL_CHOLESKY;
    return "DENSE_NORMAL_CHOLESKY";
  }
  out->linear_solver_type = ceres::SPARSE_NORMAL_CHOLESKY;
  return "SPARSE_NORMAL_CHOLESKY";
}

ceres::Solver::Options ToCeres(const SolverOptions& options) {
  ceres::Solver::Options out;
  // With more than one thread Ceres adds up the reduced system in the order in which they finish.
  out.num_threads = options.num_threads == -1 ? 1 : NumThreads(options.num_threads);
  out.max_num_iterations = options.max_num_iterations;
  out.max_linear_solver_iterations = options.max_linear_solver_iterations;
  out.eta = options.eta;
  out.max_solver_time_in_seconds = options.max_seconds;
  out.function_tolerance = 0.0;  // IterationWatch decides
  out.gradient_tolerance = options.gradient_tolerance;
  out.parameter_tolerance = options.parameter_tolerance;
  out.initial_trust_region_radius = options.initial_trust_radius;
  out.max_num_consecutive_invalid_steps = 10;
  out.update_state_every_iteration = true;  // for IterationWatch::best_state
  out.logging_type = ceres::SILENT;
  return out;
}

StopReason ReasonOf(const ceres::Solver::Summary& ceres_summary, const SolverOptions& options) {
  if (ceres_summary.termination_type == ceres::CONVERGENCE) return StopReason::kConverged;
  if (ceres_summary.termination_type == ceres::NO_CONVERGENCE) {
    return ceres_summary.total_time_in_seconds >= options.max_seconds ? StopReason::kMaxTime
                                                                      : StopReason::kMaxIterations;
  }
  return StopReason::kNoStep;
}

double TotalCost(const std::vector<TermCost>& terms) {
  double cost = 0.0;
  for (const TermCost& term : terms) cost += term.cost;
  return cost;
}

// After a failure the last evaluation was not of the state that is kept.
void RestoreBestState(const IterationWatch& watch, Problem* problem,
                      std::vector<ResidualMemory>* memories) {
  if (!watch.best_state().empty()) problem->state() = watch.best_state();
  for (size_t b = 0; b < problem->batches().size(); ++b) {
    const ResidualBatch& batch = *problem->batches()[b];
    for (size_t i = 0; i < batch.size(); ++i)
      Remember(batch, i, problem->Reader(), &(*memories)[b]);
  }
}

// Why Ceres stopped, unless IterationWatch stopped it, and its times.
void TakeSummary(const ceres::Solver::Summary& from, const SolverOptions& options,
                 SolverSummary* to) {
  if (from.termination_type != ceres::USER_SUCCESS &&
      from.termination_type != ceres::USER_FAILURE) {
    to->stop_reason = ReasonOf(from, options);
    to->message = from.message;
  }
  to->linearise_seconds =
      from.jacobian_evaluation_time_in_seconds + from.residual_evaluation_time_in_seconds;
  to->eliminate_seconds = from.linear_solver_time_in_seconds;
  to->build_seconds += from.preprocessor_time_in_seconds;
}

}  // namespace

SolverSummary SolveWithCeres(const SolverOptions& options, Problem* problem) {
  // The summary and the iterations show what Ceres would warn of.
  FLAGS_minloglevel = google::GLOG_ERROR;
  const Timer timer;
  SolverSummary summary;
  summary.backend = "ceres";
  summary.reduced_system.size = NumKeptUnknowns(*problem);
  CeresProblem ceres_problem;
  const auto ordering = std::make_shared<ceres::ParameterBlockOrdering>();
  CeresBuilder(problem, &ceres_problem, ordering.get());
  summary.build_seconds = timer.Seconds();

  IterationWatch watch(options, *problem, ceres_problem.memories, &summary);
  if (ordering->NumElements() > 0) {
    ceres::Solver::Options ceres_options = ToCeres(options);
    const std::string schur_solver = SetLinearSolver(options, ceres_problem, &ceres_options);
    summary.linear_solver = SetOrdering(ordering, schur_solver, &ceres_options);
    summary.num_threads = ceres_options.num_threads;
    ceres_options.callbacks.push_back(&watch);
    ceres::Solver::Summary ceres_summary;
    ceres::Solve(ceres_options, &ceres_problem.problem, &ceres_summary);
    TakeSummary(ceres_summary, options, &summary);
    if (!ceres_summary.IsSolutionUsable())
      RestoreBestState(watch, problem, &ceres_problem.memories);
  }

  summary.final_terms = TermsFromMemory(*problem, ceres_problem.memories);
  if (!watch.was_called()) summary.initial_terms = summary.final_terms;
  summary.initial_cost = TotalCost(summary.initial_terms);
  summary.final_cost = TotalCost(summary.final_terms);
  summary.iterations = static_cast<int>(summary.iteration_seconds.size());
  summary.total_seconds = timer.Seconds();
  return summary;
}

}  // namespace holba
