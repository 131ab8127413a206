// SPDX-License-Identifier: BSD-3-Clause
#include "holba/solver/ceres/ceres_backend.h"

#include <ceres/ceres.h>
#include <glog/logging.h>

#include <algorithm>
#include <cmath>
#include <deque>
#include <map>
#include <memory>

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

// Everything that must outlive the Ceres problem.
struct CeresProblem {
  ceres::Problem problem;
  std::vector<std::unique_ptr<ceres::Manifold>> manifolds;
  std::vector<std::unique_ptr<ceres::LossFunction>> losses;
  std::deque<CeresResidual> residuals;   // side by side, as they are evaluated
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

// Brings the memory of one residual up to date with the problem's state; if it is absent there, it
// keeps what it had.
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

// Residuals without variable blocks are left out and remembered here for good; the others are
// remembered when Ceres evaluates them with Jacobians, at the start and at every accepted state.
void Fill(Problem& problem, CeresProblem* out, ceres::ParameterBlockOrdering* ordering) {
  const ParameterReader reader = problem.Reader();
  out->memories.resize(problem.batches().size());
  std::map<std::pair<const ManifoldOps*, uint32_t>, ceres::Manifold*> manifolds;
  std::vector<uint8_t> added(problem.num_blocks(), 0);
  const auto add_block = [&](BlockId id) {
    if (added[id]) return;
    added[id] = 1;
    const ParameterBlock& block = problem.block(id);
    const ManifoldOps& ops = *block.manifold;
    double* values = problem.values(id);
    out->problem.AddParameterBlock(values, ops.ambient);
    if (!block.IsVariable()) {
      out->problem.SetParameterBlockConstant(values);
      return;
    }
    if (ops.ambient != ops.tangent || block.held) {
      ceres::Manifold*& manifold = manifolds[{&ops, block.held}];
      if (!manifold) {
        out->manifolds.push_back(std::make_unique<CeresManifold>(ops, block.held));
        manifold = out->manifolds.back().get();
      }
      out->problem.SetManifold(values, manifold);
    }
    ordering->AddElementToGroup(values, IsKept(block.role) ? 1 : 0);
    out->num_variable_frames += block.role == BlockRole::kPose;
    if (IsKept(block.role)) out->num_kept_unknowns += block.FreeTangent();
  };
  for (size_t b = 0; b < problem.batches().size(); ++b) {
    const ResidualBatch& batch = *problem.batches()[b];
    out->losses.push_back(std::make_unique<CeresLoss>(batch.loss, batch.weight));
    ceres::LossFunction* loss = out->losses.back().get();
    if (batch.loss.type == LossType::kTrivial && batch.weight == 1.0) loss = nullptr;
    out->memories[b].Resize(batch.size(), batch.dim());
    std::vector<double*> parameters(batch.num_slots());
    for (size_t i = 0; i < batch.size(); ++i) {
      bool variable = false;
      for (int s = 0; s < batch.num_slots(); ++s) {
        variable |= problem.block(batch.block(i, s)).IsVariable();
      }
      if (!variable) {
        Remember(batch, i, reader, &out->memories[b]);
        continue;
      }
      for (int s = 0; s < batch.num_slots(); ++s) {
        add_block(batch.block(i, s));
        parameters[s] = problem.values(batch.block(i, s));
      }
      out->residuals.emplace_back(problem, batch, i, &out->memories[b]);
      out->problem.AddResidualBlock(&out->residuals.back(), loss, parameters);
    }
  }
}

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
    IterationRecord record;
    record.iteration = it.iteration;
    record.accepted = it.iteration == 0 || it.step_is_successful;
    record.cost = it.cost;
    record.cost_change = it.cost_change;
    record.gradient_max_norm = it.gradient_max_norm;
    record.step_norm = it.step_norm;
    record.trust_radius = it.trust_region_radius;
    record.seconds = it.iteration_time_in_seconds;
    if (it.iteration == 0) {
      was_called_ = true;
      summary_->initial_terms = TermsFromMemory(problem_, memories_);
      constant_cost_ = -it.cost;
      for (const TermCost& term : summary_->initial_terms) constant_cost_ += term.cost;
    }
    if (options_.on_iteration || watches_terms_)
      record.terms = TermsFromMemory(problem_, memories_);
    if (record.accepted) best_state_ = problem_.state();
    if (it.iteration > 0) {
      summary_->iteration_seconds.push_back(record.seconds);
      summary_->accepted_steps += record.accepted;
    }
    if (options_.on_iteration && !options_.on_iteration(record)) {
      summary_->stop_reason = StopReason::kCallback;
      return ceres::SOLVER_TERMINATE_SUCCESSFULLY;  // an abort would lose the best state
    }
    double watched = watches_terms_ ? 0.0 : it.cost + constant_cost_;
    if (watches_terms_) {
      for (const TermCost& term : record.terms) watched += term.angular ? 0.0 : term.cost;
    }
    const double before = watched_;
    watched_ = watched;
    if (it.iteration == 0 || !record.accepted) return ceres::SOLVER_CONTINUE;
    if (std::abs(before - watched) <= options_.function_tolerance * before) {
      summary_->stop_reason = StopReason::kConverged;
      summary_->message = "the cost of the terms in pixels changes less than function_tolerance";
      return ceres::SOLVER_TERMINATE_SUCCESSFULLY;
    }
    return ceres::SOLVER_CONTINUE;
  }

  // The last accepted one: Ceres itself goes back to the start when it fails.
  const std::vector<double>& best_state() const { return best_state_; }
  // Whether Ceres came as far as to evaluate the start.
  bool was_called() const { return was_called_; }

 private:
  const SolverOptions& options_;
  const Problem& problem_;
  const std::vector<ResidualMemory>& memories_;
  SolverSummary* summary_;
  std::vector<double> best_state_;
  bool watches_terms_ = false;  // not simply the cost
  bool was_called_ = false;
  double watched_ = 0.0;
  double constant_cost_ = 0.0;  // of residuals that Ceres does not have
};

ceres::Solver::Options ToCeres(const SolverOptions& options, const CeresProblem& problem,
                               SolverSummary* summary) {
  ceres::Solver::Options ceres_options;
  LinearSolver linear = options.linear_solver;
  if (linear == LinearSolver::kAuto) {
    linear = problem.num_variable_frames <= kMaxFramesDense    ? LinearSolver::kDense
             : problem.num_variable_frames <= kMaxFramesSparse ? LinearSolver::kSparse
                                                               : LinearSolver::kIterative;
  }
  switch (linear) {
    case LinearSolver::kAuto:
    case LinearSolver::kDense: {
      const bool wanted = options.ceres_dense_library == CeresDenseLibrary::kAuto
                              ? problem.num_kept_unknowns >= kMinSizeLapack
                              : options.ceres_dense_library == CeresDenseLibrary::kLapack;
      const bool lapack = wanted && ceres::IsDenseLinearAlgebraLibraryTypeAvailable(ceres::LAPACK);
      ceres_options.linear_solver_type = ceres::DENSE_SCHUR;
      ceres_options.dense_linear_algebra_library_type = lapack ? ceres::LAPACK : ceres::EIGEN;
      summary->linear_solver = lapack ? "DENSE_SCHUR (LAPACK)" : "DENSE_SCHUR (Eigen)";
      break;
    }
    case LinearSolver::kSparse:
      ceres_options.linear_solver_type = ceres::SPARSE_SCHUR;
      if (ceres::IsSparseLinearAlgebraLibraryTypeAvailable(ceres::SUITE_SPARSE)) {
        ceres_options.sparse_linear_algebra_library_type = ceres::SUITE_SPARSE;
        summary->linear_solver = "SPARSE_SCHUR (SuiteSparse)";
      } else {
        ceres_options.sparse_linear_algebra_library_type = ceres::EIGEN_SPARSE;
        summary->linear_solver = "SPARSE_SCHUR (Eigen)";
      }
      break;
    case LinearSolver::kIterative:
      ceres_options.linear_solver_type = ceres::ITERATIVE_SCHUR;
      ceres_options.preconditioner_type = ceres::SCHUR_JACOBI;
      summary->linear_solver = "ITERATIVE_SCHUR (SCHUR_JACOBI)";
      break;
  }
  // With more threads Ceres adds up the reduced system in whatever order they finish.
  ceres_options.num_threads = options.num_threads == -1 ? 1 : NumThreads(options.num_threads);
  ceres_options.max_num_iterations = options.max_num_iterations;
  ceres_options.max_linear_solver_iterations = options.max_linear_solver_iterations;
  ceres_options.eta = options.eta;
  ceres_options.max_solver_time_in_seconds = options.max_seconds;
  ceres_options.function_tolerance = 0.0;  // IterationWatch decides
  ceres_options.gradient_tolerance = options.gradient_tolerance;
  ceres_options.parameter_tolerance = options.parameter_tolerance;
  ceres_options.initial_trust_region_radius = options.initial_trust_radius;
  ceres_options.max_num_consecutive_invalid_steps = 10;
  ceres_options.update_state_every_iteration = true;  // for IterationWatch::best_state
  ceres_options.logging_type = ceres::SILENT;
  return ceres_options;
}

StopReason ReasonOf(const ceres::Solver::Summary& ceres_summary, const SolverOptions& options) {
  if (ceres_summary.termination_type == ceres::CONVERGENCE) return StopReason::kConverged;
  if (ceres_summary.termination_type == ceres::NO_CONVERGENCE) {
    return ceres_summary.total_time_in_seconds >= options.max_seconds ? StopReason::kMaxTime
                                                                      : StopReason::kMaxIterations;
  }
  return StopReason::kNoStep;
}

}  // namespace

SolverSummary SolveWithCeres(const SolverOptions& options, Problem* problem) {
  // Ceres' warnings (a step that could not be solved for, ...) show in the summary and the
  // iterations.
  FLAGS_minloglevel = google::GLOG_ERROR;
  SolverSummary summary;
  summary.backend = "ceres";
  summary.reduced_system.size = NumKeptUnknowns(*problem);
  const Timer timer;

  CeresProblem ceres_problem;
  const auto ordering = std::make_shared<ceres::ParameterBlockOrdering>();
  Fill(*problem, &ceres_problem, ordering.get());
  summary.build_seconds = timer.Seconds();
  const auto sum = [](const std::vector<TermCost>& terms) {
    double cost = 0.0;
    for (const TermCost& term : terms) cost += term.cost;
    return cost;
  };
  if (ordering->NumElements() == 0) {
    summary.initial_terms = summary.final_terms = TermsFromMemory(*problem, ceres_problem.memories);
    summary.initial_cost = summary.final_cost = sum(summary.initial_terms);
    summary.total_seconds = timer.Seconds();
    return summary;
  }

  ceres::Solver::Options ceres_options = ToCeres(options, ceres_problem, &summary);
  // A Schur solver needs both groups; with only one there is nothing to eliminate from.
  if (ordering->NumGroups() == 2) {
    ceres_options.linear_solver_ordering = ordering;
  } else if (ceres_options.linear_solver_type == ceres::DENSE_SCHUR && ordering->GroupSize(1) > 0) {
    ceres_options.linear_solver_type = ceres::DENSE_NORMAL_CHOLESKY;
    summary.linear_solver = "DENSE_NORMAL_CHOLESKY";
  } else {
    ceres_options.linear_solver_type = ceres::SPARSE_NORMAL_CHOLESKY;
    summary.linear_solver = "SPARSE_NORMAL_CHOLESKY";
  }
  summary.num_threads = ceres_options.num_threads;
  summary.stop_reason = StopReason::kMaxIterations;
  IterationWatch watch(options, *problem, ceres_problem.memories, &summary);
  ceres_options.callbacks.push_back(&watch);

  ceres::Solver::Summary ceres_summary;
  ceres::Solve(ceres_options, &ceres_problem.problem, &ceres_summary);

  if (ceres_summary.termination_type != ceres::USER_SUCCESS &&
      ceres_summary.termination_type != ceres::USER_FAILURE) {
    summary.stop_reason = ReasonOf(ceres_summary, options);
    summary.message = ceres_summary.message;
  }
  if (!ceres_summary.IsSolutionUsable()) {
    // The last evaluation was not of the state that is kept.
    if (!watch.best_state().empty()) problem->state() = watch.best_state();
    for (size_t b = 0; b < problem->batches().size(); ++b) {
      const ResidualBatch& batch = *problem->batches()[b];
      for (size_t i = 0; i < batch.size(); ++i) {
        Remember(batch, i, problem->Reader(), &ceres_problem.memories[b]);
      }
    }
  }
  summary.final_terms = TermsFromMemory(*problem, ceres_problem.memories);
  if (!watch.was_called()) summary.initial_terms = summary.final_terms;
  summary.initial_cost = sum(summary.initial_terms);
  summary.final_cost = sum(summary.final_terms);
  summary.iterations = static_cast<int>(summary.iteration_seconds.size());
  summary.linearise_seconds = ceres_summary.jacobian_evaluation_time_in_seconds +
                              ceres_summary.residual_evaluation_time_in_seconds;
  summary.eliminate_seconds = ceres_summary.linear_solver_time_in_seconds;
  summary.build_seconds += ceres_summary.preprocessor_time_in_seconds;
  summary.total_seconds = timer.Seconds();
  return summary;
}

}  // namespace holba
