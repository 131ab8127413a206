// SPDX-License-Identifier: BSD-3-Clause
#include "holba/solver/native/native_backend.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "holba/base/threads.h"
#include "holba/base/timer.h"
#include "holba/linear/conjugate_gradients.h"
#include "holba/linear/preconditioner.h"
#include "holba/linear/reduced_solver.h"
#include "holba/solver/native/linear_choice.h"
#include "holba/solver/native/normal_equations.h"

namespace holba {
namespace {

using native::Linearisation;
using native::NormalEquations;
using native::SchurForm;
using native::StateCost;
using native::Trial;

// As Ceres: a step counts if the cost falls by this share of what the model promises, and radii
// below this mean that no step improves.
constexpr double kMinGainRatio = 1e-3;
constexpr double kMinRadius = 1e-32;
constexpr double kMaxRadius = 1e16;
constexpr int kPowerSeriesOrder = 3;
// Shared intrinsics, which all images see, are worth treating exactly; a hundred planes cost more
// than the products that this saves.
constexpr size_t kMaxBorderUnknowns = 32;

// How the reduced system is solved, and with what.
class StepSolver {
 public:
  virtual ~StepSolver() = default;
  // The kept unknowns' step; false: none found at this damping.
  virtual bool Solve(NormalEquations* equations, std::span<double> step) = 0;
  // The direct solver, if it is one.
  virtual ReducedSolver* Direct() { return nullptr; }
  // Before another problem of the same pattern.
  virtual void Reset() {}
  virtual std::string Name() const = 0;
};

class DirectStep final : public StepSolver {
 public:
  DirectStep(std::unique_ptr<ReducedSolver> solver) : solver_(std::move(solver)) {}
  bool Solve(NormalEquations* equations, std::span<double> step) override {
    return solver_->Factorise(equations->matrix()) &&
           solver_->Solve(equations->rhs().data(), step.data());
  }
  ReducedSolver* Direct() override { return solver_.get(); }
  void Reset() override { solver_->Reset(); }
  std::string Name() const override { return solver_->Name(); }

 private:
  std::unique_ptr<ReducedSolver> solver_;
};

// y = S x = (U + D) x - T T^T x.
class ImplicitSchur final : public LinearOperator {
 public:
  ImplicitSchur(NormalEquations* equations, int num_threads)
      : equations_(*equations), num_threads_(num_threads) {}
  void Apply(const double* x, double* y) override {
    equations_.U().Multiply(x, y, num_threads_, &scratch_);
    product_.resize(equations_.pattern().num_unknowns);
    equations_.MultiplyEliminated(x, product_.data());
    for (size_t i = 0; i < product_.size(); ++i) y[i] -= product_[i];
  }

 private:
  NormalEquations& equations_;
  int num_threads_;
  std::vector<double> scratch_, product_;
};
class EliminatedPart final : public LinearOperator {
 public:
  explicit EliminatedPart(NormalEquations* equations) : equations_(*equations) {}
  void Apply(const double* x, double* y) override { equations_.MultiplyEliminated(x, y); }

 private:
  NormalEquations& equations_;
};

// What auto stands for.
PreconditionerType ChoosePreconditioner(PreconditionerType wanted,
                                        const native::Structure& structure) {
  if (wanted != PreconditionerType::kAuto) return wanted;
  size_t border_unknowns = 0;
  for (size_t n = structure.num_pose_nodes; n < structure.num_nodes(); ++n)
    border_unknowns += structure.node_width[n];
  return border_unknowns > 0 && border_unknowns <= kMaxBorderUnknowns
             ? PreconditionerType::kBorder
             : PreconditionerType::kBlockJacobi;
}

class IterativeStep final : public StepSolver {
 public:
  IterativeStep(const SolverOptions& options, PreconditionerType type, NormalEquations* equations,
                int num_threads)
      : schur_(equations, num_threads), eliminated_(equations) {
    const BlockPattern& pattern = equations->pattern();
    const int num_poses = static_cast<int>(equations->structure().num_pose_nodes);
    switch (type) {
      case PreconditionerType::kAuto:
      case PreconditionerType::kBlockJacobi:
        jacobi_ = std::make_unique<BlockJacobiPreconditioner>(pattern, num_threads);
        preconditioner_ = jacobi_.get();
        name_ = "block Jacobi";
        break;
      case PreconditionerType::kBorder:
        border_ = std::make_unique<BorderPreconditioner>(pattern, num_poses, BorderOptions(),
                                                         num_threads);
        preconditioner_ = border_.get();
        name_ = "border";
        break;
      case PreconditionerType::kPowerSeries:
        border_ = std::make_unique<BorderPreconditioner>(pattern, num_poses, BorderOptions(),
                                                         num_threads);
        of_u_ = true;
        series_ = std::make_unique<PowerSeriesPreconditioner>(
            border_.get(), &eliminated_, pattern.num_unknowns, kPowerSeriesOrder);
        preconditioner_ = series_.get();
        name_ = "power series";
        break;
    }
    cg_options_.max_iterations = options.max_linear_solver_iterations;
    cg_options_.eta = options.eta;
  }
  bool Solve(NormalEquations* equations, std::span<double> step) override {
    const BlockMatrix& matrix = of_u_ ? equations->U() : equations->matrix();
    if (jacobi_) jacobi_->Set(matrix);
    if (border_) border_->Set(matrix);
    const ConjugateGradientsResult result = cg_.Solve(
        &schur_, preconditioner_, step.size(), equations->rhs().data(), cg_options_, step.data());
    return result.iterations > 0 || result.end == ConjugateGradientsEnd::kConverged;
  }
  std::string Name() const override { return "conjugate gradients, implicit, " + name_; }

 private:
  ImplicitSchur schur_;
  EliminatedPart eliminated_;
  std::unique_ptr<BlockJacobiPreconditioner> jacobi_;
  std::unique_ptr<BorderPreconditioner> border_;
  std::unique_ptr<PowerSeriesPreconditioner> series_;
  Preconditioner* preconditioner_ = nullptr;
  bool of_u_ = false;
  std::string name_;
  ConjugateGradients cg_;
  ConjugateGradientsOptions cg_options_;
};

// Features only: there is no reduced system.
class NoStep final : public StepSolver {
 public:
  bool Solve(NormalEquations*, std::span<double>) override { return true; }
  std::string Name() const override { return "none: features only"; }
};

}  // namespace

// What one solve leaves for the next.
struct NativeWorkspace::Data {
  NormalEquations equations;
  // How a step is found, and what that was made for: an analysis serves every problem with the same
  // pattern.
  struct Choice {
    LinearSolver kind = LinearSolver::kAuto;
    bool mixed = false;
    PreconditionerType preconditioner = PreconditionerType::kAuto;
    double eta = 0.0;
    int max_linear_solver_iterations = 0;
    int num_threads = 0;
    uint32_t num_pose_nodes = 0;
    uint64_t pattern_version = 0;
    bool operator==(const Choice&) const = default;
  };
  std::unique_ptr<StepSolver> solver;
  Choice made_for;
  // Of the last problem's structure, if ChooseLinearSolver was asked.
  LinearSolver chosen = LinearSolver::kAuto;

  void Begin(const Problem& problem, int num_threads) {
    if (!equations.Begin(problem, num_threads)) chosen = LinearSolver::kAuto;
  }
  // After Begin: the form of the reduced system and the solver that the options ask for.
  void Choose(const SolverOptions& options, int num_threads);
};

native::NormalEquations& NativeWorkspace::equations() { return data_->equations; }

ReducedSolver* NativeWorkspace::BeginExplicit(const Problem& problem, int num_threads) {
  Data& data = *data_;
  data.Begin(problem, num_threads);
  SolverOptions options;
  options.linear_solver = data.chosen;
  if (data.chosen != LinearSolver::kSparse && data.chosen != LinearSolver::kDense) {
    options.linear_solver = native::IsSparseFaster(data.equations.FindPattern())
                                ? LinearSolver::kSparse
                                : LinearSolver::kDense;
  }
  // One for mixed precision makes a factor in double when it is asked for the inverse.
  options.precision = data.made_for.mixed ? FactorPrecision::kMixed : FactorPrecision::kDouble;
  data.Choose(options, num_threads);
  return data.solver->Direct();
}

NativeWorkspace::NativeWorkspace() : data_(std::make_unique<Data>()) {}
NativeWorkspace::~NativeWorkspace() = default;

void NativeWorkspace::Data::Choose(const SolverOptions& options, int num_threads) {
  if (equations.structure().num_nodes() == 0) {
    equations.SetForm(SchurForm::kExplicit);
    solver = std::make_unique<NoStep>();
    made_for = {};
    return;
  }
  Choice choice;
  choice.kind = options.linear_solver;
  if (choice.kind == LinearSolver::kAuto) {
    if (chosen == LinearSolver::kAuto)
      chosen = native::ChooseLinearSolver(equations.structure(), equations.FindPattern());
    choice.kind = chosen;
  }
  const bool iterative = choice.kind == LinearSolver::kIterative;
  if (iterative)
    choice.preconditioner = ChoosePreconditioner(options.preconditioner, equations.structure());
  equations.SetForm(!iterative ? SchurForm::kExplicit
                    : choice.preconditioner == PreconditionerType::kBorder
                        ? SchurForm::kImplicitWithBorder
                        : SchurForm::kImplicit);
  const BlockPattern& pattern = equations.pattern();
  choice.num_threads = num_threads;
  choice.num_pose_nodes = equations.structure().num_pose_nodes;
  choice.pattern_version = equations.pattern_version();
  if (iterative) {
    choice.eta = options.eta;
    choice.max_linear_solver_iterations = options.max_linear_solver_iterations;
  } else {
    // Single precision pays from some hundred unknowns on.
    choice.mixed = options.precision == FactorPrecision::kMixed ||
                   (options.precision == FactorPrecision::kAuto && pattern.num_unknowns > 600);
  }
  if (solver != nullptr && choice == made_for) {
    solver->Reset();
    return;
  }
  const Precision precision = choice.mixed ? Precision::kMixed : Precision::kDouble;
  if (iterative) {
    solver =
        std::make_unique<IterativeStep>(options, choice.preconditioner, &equations, num_threads);
  } else if (choice.kind == LinearSolver::kDense) {
    solver = std::make_unique<DirectStep>(MakeDenseSolver(pattern, precision, num_threads));
  } else {
    solver = std::make_unique<DirectStep>(MakeSparseSolver(pattern, precision, num_threads));
  }
  made_for = choice;
}

namespace {

// Costs by batch, put together by term.
std::vector<TermCost> TermsOf(const Problem& problem, const StateCost& cost) {
  std::vector<TermCost> terms;
  for (size_t b = 0; b < problem.batches().size(); ++b) {
    const ResidualBatch& batch = *problem.batches()[b];
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

// Of the terms that end the iteration.
double WatchedCost(const Problem& problem, const StateCost& cost, bool angular_too) {
  double sum = 0.0;
  for (size_t b = 0; b < problem.batches().size(); ++b) {
    if (angular_too || !problem.batches()[b]->angular) sum += cost.batches[b].cost;
  }
  return sum;
}

// A gradient that is exactly 0 ends the iteration even with the tolerance off.
bool FlatEnough(const Linearisation& linearisation, const SolverOptions& options) {
  return linearisation.max_gradient <= options.gradient_tolerance;
}

}  // namespace

SolverSummary SolveNatively(const SolverOptions& options, Problem* problem,
                            NativeWorkspace* workspace) {
  const Timer timer;
  SolverSummary summary;
  summary.backend = "native";
  summary.num_threads = NumThreads(options.num_threads);
  summary.factorise_seconds = summary.back_substitute_seconds = 0.0;
  NativeWorkspace::Data& data = workspace->data();
  data.Begin(*problem, summary.num_threads);
  data.Choose(options, summary.num_threads);
  NormalEquations& equations = data.equations;
  StepSolver* const solver = data.solver.get();
  const bool nothing_to_do =
      equations.structure().num_nodes() == 0 && equations.structure().features.empty();
  summary.linear_solver = solver->Name();
  summary.reduced_system.size = NumKeptUnknowns(*problem);
  summary.build_seconds = timer.Seconds();

  Linearisation here;
  Trial trial;
  double radius = options.initial_trust_radius, shrink = 2.0;
  std::vector<double> step(equations.pattern().num_unknowns);
  IterationRecord record;
  const auto report = [&](const Timer& iteration_timer) {
    record.seconds = iteration_timer.Seconds();
    record.trust_radius = radius;
    record.gradient_max_norm = here.max_gradient;
    if (record.iteration > 0) summary.iteration_seconds.push_back(record.seconds);
    if (!options.on_iteration) return true;
    record.terms = TermsOf(*problem, here.cost);
    return options.on_iteration(record);
  };

  const auto linearise = [&] {
    const Timer phase;
    equations.Linearise(radius, &here);
    const double seconds = phase.Seconds();
    summary.linearise_seconds += here.evaluation_share * seconds;
    summary.eliminate_seconds += (1.0 - here.evaluation_share) * seconds;
  };

  {
    const Timer iteration_timer;
    linearise();
    record.cost = here.cost.total;
    summary.initial_terms = TermsOf(*problem, here.cost);
    summary.initial_cost = here.cost.total;
    summary.stop_reason = StopReason::kMaxIterations;
    if (nothing_to_do) {
      summary.stop_reason = StopReason::kNothingToDo;
    } else if (!report(iteration_timer)) {
      summary.stop_reason = StopReason::kCallback;
    } else if (FlatEnough(here, options)) {
      summary.stop_reason = StopReason::kConverged;
      summary.message = "the gradient is below gradient_tolerance";
    }
  }

  bool linearised = true;  // at the current state with the current radius
  while (summary.stop_reason == StopReason::kMaxIterations &&
         summary.iterations < options.max_num_iterations) {
    if (timer.Seconds() >= options.max_seconds) {
      summary.stop_reason = StopReason::kMaxTime;
      break;
    }
    const Timer iteration_timer;
    if (!linearised) {
      linearise();
      linearised = true;
    }
    // A step of the linear model, and where it leads.
    const Timer factorise_timer;
    const bool solved = solver->Solve(&equations, step);
    summary.factorise_seconds += factorise_timer.Seconds();
    double gain_ratio = -1.0;
    if (solved) {
      const Timer phase;
      equations.Step(step, &trial);
      summary.back_substitute_seconds += phase.Seconds();
      const double change = here.cost.total - trial.cost.total;
      if (trial.model_change < 0.0 && std::isfinite(trial.cost.total))
        gain_ratio = change / -trial.model_change;
    }
    ++summary.iterations;
    record.iteration = summary.iterations;
    record.accepted = gain_ratio > kMinGainRatio;
    record.cost_change = solved ? here.cost.total - trial.cost.total : 0.0;
    record.step_norm = solved ? trial.step_norm : 0.0;

    if (!record.accepted) {
      // Where even a negligible step does not improve, this is as good as it gets.
      const bool negligible =
          solved && trial.step_norm <= options.parameter_tolerance *
                                           (trial.state_norm + options.parameter_tolerance);
      radius /= shrink;
      shrink *= 2.0;
      linearised = false;
      const bool go_on = report(iteration_timer);
      if (!go_on) {
        summary.stop_reason = StopReason::kCallback;
      } else if (negligible) {
        summary.stop_reason = StopReason::kConverged;
        summary.message = "the step is shorter than parameter_tolerance";
      } else if (radius < kMinRadius) {
        summary.stop_reason = StopReason::kNoStep;
        summary.message = "no step improves, however short";
      }
      continue;
    }

    ++summary.accepted_steps;
    const double before = WatchedCost(*problem, here.cost, options.termination_counts_angular);
    equations.Accept(problem);
    here.cost = trial.cost;
    const double after = WatchedCost(*problem, here.cost, options.termination_counts_angular);
    here.cost.CountAppeared();
    radius = std::min(radius / std::max(1.0 / 3.0, 1.0 - std::pow(2.0 * gain_ratio - 1.0, 3)),
                      kMaxRadius);
    shrink = 2.0;
    record.cost = here.cost.total;
    // The gradient there comes with the linearisation, which is the next iteration's anyway.
    const bool last = summary.iterations >= options.max_num_iterations;
    const bool converged = options.function_tolerance > 0.0 &&
                           std::abs(before - after) <= options.function_tolerance * before;
    const bool short_step = trial.step_norm <= options.parameter_tolerance *
                                                   (trial.state_norm + options.parameter_tolerance);
    linearised = false;
    if (!converged && !short_step && !last) {
      linearise();
      linearised = true;
    }
    if (!report(iteration_timer)) {
      summary.stop_reason = StopReason::kCallback;
    } else if (converged) {
      summary.stop_reason = StopReason::kConverged;
      summary.message = "the cost of the terms in pixels changes less than function_tolerance";
    } else if (short_step) {
      summary.stop_reason = StopReason::kConverged;
      summary.message = "the step is shorter than parameter_tolerance";
    } else if (linearised && FlatEnough(here, options)) {
      summary.stop_reason = StopReason::kConverged;
      summary.message = "the gradient is below gradient_tolerance";
    }
  }

  summary.final_terms = TermsOf(*problem, here.cost);
  summary.final_cost = here.cost.total;
  summary.total_seconds = timer.Seconds();
  return summary;
}

}  // namespace holba
