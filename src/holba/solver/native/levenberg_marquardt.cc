// SPDX-License-Identifier: BSD-3-Clause
#include "holba/solver/native/levenberg_marquardt.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>

#include "holba/base/timer.h"
#include "holba/solver/solve_journal.h"

namespace holba::native {
namespace {

// As in Ceres. A step is accepted if its gain ratio, the decrease of the cost over the decrease
// that the linear model predicts, exceeds kMinGainRatio.
constexpr double kMinGainRatio = 1e-3;
constexpr double kMinRadius = 1e-32;  // no step of this trust region can change the state
constexpr double kMaxRadius = 1e16;

Stop Converged(std::string message) { return {StopReason::kConverged, std::move(message)}; }

// Levenberg-Marquardt (Marquardt 1963), with the trust region of Ceres.
class LevenbergMarquardt {
 public:
  LevenbergMarquardt(const SolverOptions& options, const Problem& problem,
                     LinearisedProblem* system, SolveLog* log)
      : options_(options),
        problem_(problem),
        system_(*system),
        log_(*log),
        radius_(options.initial_trust_radius) {}

  void Minimise() {
    Start();
    while (!Finished()) {
      log_.BeginIteration();
      if (!linearised_) Linearise();
      ComputeStep();
      const std::optional<Stop> stop = IsGood() ? AcceptStep() : RejectStep();
      EndIteration(stop);
    }
  }

  const StateCost& cost() const { return here_.cost; }
  const Stop& stop() const { return *stop_; }

 private:
  void Start() {
    log_.BeginIteration();
    if (options_.journal != nullptr && options_.journal->loop())
      return GoOn(*options_.journal->loop());
    Linearise();
    log_.SetStart(here_.cost);
    if (system_.IsEmpty()) {
      stop_ = {StopReason::kNothingToDo, ""};
    } else {
      EndIteration(StopIfFlat());
    }
  }

  // From where a journal says that the loop was.
  void GoOn(const LoopState& loop) {
    system_.Restore(loop);
    radius_ = loop.radius;
    shrink_ = loop.shrink;
    log_.Restore(loop);
    Linearise();
  }
  void SaveIfDue() {
    if (options_.journal == nullptr || stop_ || !options_.journal->IsDue(log_.iterations())) return;
    LoopState loop;
    loop.radius = radius_;
    loop.shrink = shrink_;
    log_.Save(&loop);
    system_.Save(&loop);
    options_.journal->Save(loop);
  }

  bool Finished() {
    if (!stop_ && log_.iterations() >= options_.max_num_iterations)
      stop_ = {StopReason::kMaxIterations, ""};
    if (!stop_ && system_.Agree(log_.Seconds() >= options_.max_seconds))
      stop_ = {StopReason::kMaxTime, ""};
    return stop_.has_value();
  }

  void Linearise() {
    const Timer timer;
    system_.Linearise(radius_, &here_);
    log_.AddLinearisation(timer.Seconds(), here_);
    linearised_ = true;
  }

  // The step of the kept unknowns, then that of the features and the cost where both lead.
  void ComputeStep() {
    const Timer factorise_timer;
    solved_ = system_.SolveKept();
    log_.AddFactorisation(factorise_timer.Seconds());
    if (!solved_) return;
    const Timer step_timer;
    system_.Step(&trial_);
    log_.AddBackSubstitution(step_timer.Seconds());
  }

  double CostDecrease() const { return here_.cost.total - trial_.cost.total; }
  double GainRatio() const {
    const bool comparable =
        solved_ && trial_.model_change < 0.0 && std::isfinite(trial_.cost.total);
    return comparable ? CostDecrease() / -trial_.model_change : -1.0;
  }
  bool IsGood() const { return GainRatio() > kMinGainRatio; }
  bool IsNegligible() const {
    return solved_ && trial_.step_norm <= options_.parameter_tolerance *
                                              (trial_.state_norm + options_.parameter_tolerance);
  }

  // Moves to the trial state and, unless the solve ends there, linearises, since the gradient
  // there decides whether to go on.
  std::optional<Stop> AcceptStep() {
    log_.AddStep(true, CostDecrease(), trial_.step_norm);
    radius_ = std::min(radius_ / std::max(1.0 / 3.0, 1.0 - std::pow(2.0 * GainRatio() - 1.0, 3)),
                       kMaxRadius);
    shrink_ = 2.0;
    const double before = WatchedCost();
    system_.Accept();
    here_.cost = trial_.cost;
    const double after = WatchedCost();
    here_.cost.CountAppeared();
    log_.SetCost(here_.cost);
    linearised_ = false;
    if (options_.function_tolerance > 0.0 &&
        std::abs(before - after) <= options_.function_tolerance * before)
      return Converged("the cost of the terms in pixels changes less than function_tolerance");
    if (IsNegligible()) return StopAtShortStep();
    if (log_.iterations() >= options_.max_num_iterations) return std::nullopt;
    Linearise();
    return StopIfFlat();
  }

  // Stays, with more damping.
  std::optional<Stop> RejectStep() {
    log_.AddStep(false, solved_ ? CostDecrease() : 0.0, solved_ ? trial_.step_norm : 0.0);
    radius_ /= shrink_;
    shrink_ *= 2.0;
    linearised_ = false;
    // If even a negligible step does not decrease the cost, the state is a minimum.
    if (IsNegligible()) return StopAtShortStep();
    if (radius_ < kMinRadius) return Stop{StopReason::kNoStep, "no step improves, however short"};
    return std::nullopt;
  }

  void EndIteration(const std::optional<Stop>& stop) {
    const bool goes_on = system_.Agree(log_.EndIteration(here_, radius_));
    stop_ = goes_on ? stop : Stop{StopReason::kCallback, ""};
    SaveIfDue();
  }

  static Stop StopAtShortStep() {
    return Converged("the step is shorter than parameter_tolerance");
  }
  // A gradient that is exactly 0 ends the iteration even where the tolerance is 0.
  std::optional<Stop> StopIfFlat() const {
    if (!(here_.max_gradient <= options_.gradient_tolerance)) return std::nullopt;
    return Converged("the gradient is below gradient_tolerance");
  }

  // Cost of the terms that function_tolerance looks at.
  double WatchedCost() const {
    double sum = 0.0;
    for (size_t b = 0; b < problem_.batches().size(); ++b) {
      if (options_.termination_counts_angular || !problem_.batches()[b]->angular)
        sum += here_.cost.batches[b].cost;
    }
    return sum;
  }

  const SolverOptions& options_;
  const Problem& problem_;
  LinearisedProblem& system_;
  SolveLog& log_;

  double radius_;        // of the trust region; the damping is its inverse
  double shrink_ = 2.0;  // the next rejected step divides the radius by this
  Linearisation here_;
  bool linearised_ = false;  // here_ belongs to the current state and radius
  bool solved_ = false;      // there is a step, and trial_ belongs to it
  Trial trial_;
  std::optional<Stop> stop_;
};

}  // namespace

SolverSummary Minimise(const SolverOptions& options, const Problem& problem,
                       LinearisedProblem* system, SolveLog* log) {
  LevenbergMarquardt solver(options, problem, system, log);
  solver.Minimise();
  return log->Finish(solver.cost(), solver.stop());
}

}  // namespace holba::native
