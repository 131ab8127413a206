// SPDX-License-Identifier: BSD-3-Clause
#include "holba/bundle/adjust_bundle.h"

#include <fmt/format.h>

#include <algorithm>
#include <optional>

#include "holba/base/timer.h"
#include "holba/base/words.h"
#include "holba/bundle/bundle_problem.h"
#include "holba/bundle/losses.h"
#include "holba/bundle/weight_choice.h"

namespace holba {
namespace {

constexpr int kMaxRounds = 12;
// A round before the last need not converge: it only has to bring the residuals near.
constexpr int kRoundIterations = 15;
constexpr double kRoundTolerance = 1e-4;

void Accumulate(const SolverSummary& round, SolverSummary* sum) {
  SolverSummary merged = round;
  merged.iterations += sum->iterations;
  merged.accepted_steps += sum->accepted_steps;
  merged.build_seconds += sum->build_seconds;
  merged.linearise_seconds += sum->linearise_seconds;
  merged.eliminate_seconds += sum->eliminate_seconds;
  merged.total_seconds += sum->total_seconds;
  // Negative: unknown.
  if (sum->factorise_seconds > 0.0) merged.factorise_seconds += sum->factorise_seconds;
  if (sum->back_substitute_seconds > 0.0)
    merged.back_substitute_seconds += sum->back_substitute_seconds;
  merged.iteration_seconds.insert(merged.iteration_seconds.begin(), sum->iteration_seconds.begin(),
                                  sum->iteration_seconds.end());
  *sum = std::move(merged);
}

void SetTerms(const Problem& problem, std::vector<TermCost>* terms, double* cost) {
  *terms = EvaluateTerms(problem);
  *cost = 0.0;
  for (const TermCost& term : *terms) *cost += term.cost;
}

// One adjustment of one selection: its rounds share gauge, loss scales, log and summary. The
// sequence of Run is drawn in docs/adjust.md.
class Adjuster {
 public:
  Adjuster(const BundleOptions& options, const SolverOptions& solver_options,
           const BundleSelection& selection, Reconstruction* model,
           std::span<const GroupMeasurement> measurements, const RoundLog& log,
           const NoiseSigmas& known = {})
      : options_(options),
        solver_options_(solver_options),
        selection_(selection),
        model_(*model),
        measurements_(measurements),
        log_(log),
        scales_(options_, known) {}

  BundleSummary Run() {
    summary_.held_intrinsics = selection_.HoldUncertainIntrinsics(model_, options_);
    summary_.held_sensors = selection_.held_sensors;
    const Followers followers(model_, selection_.points_seen_once, selection_.lines_seen_once);
    const std::vector<double> start = Build().problem.state();
    const bool chooses = HasChoice();
    if (HasAssociations() || chooses) AdjustFeatures();
    if (HasAssociations()) GateAssociations();
    if (chooses) ChooseWeights();
    BundleProblem bundle = AdjustAll();
    WriteBack(bundle, &model_);
    followers.Place(&model_);
    Summarise(start, &bundle);
    return std::move(summary_);
  }

 private:
  // All that is selected, with the associations that have passed.
  BundleProblem Build() const {
    return BuildProblem(model_, options_, selection_, measurements_, &summary_.filter);
  }
  // Points and lines alone.
  BundleProblem BuildFeatures(const BundleSelection& selection) const {
    BundleOptions features_only = options_;
    features_only.config = BundleConfig::kPointLine;
    return BuildProblem(model_, features_only, selection);
  }

  bool HasAssociations() const {
    return options_.gate && options_.config >= BundleConfig::kGroups &&
           (!selection_.groups.empty() || !selection_.wireframe.empty());
  }
  // Whether something besides points moves cameras, and points could say how much it should.
  bool HasChoice() const {
    return options_.choose_weights && options_.config != BundleConfig::kPoint &&
           selection_.HasVariableFrame() && !options_.fix_points &&
           !selection_.gauge.needs_structure && scales_.Measures("point");
  }

  // Points and lines alone: what structure is tested on.
  void AdjustFeatures() {
    BundleProblem bundle = BuildFeatures(selection_);
    AnnealAndSolve(HasAssociations() ? solver_options_ : Short(), &bundle.problem);
    WriteBack(bundle, &model_);
  }

  // Rounds of testing and adjusting. Leaves the model near the optimum of the associations that
  // passed.
  void GateAssociations() {
    for (int round = 0; round < options_.gate_rounds && !stopped_; ++round) {
      const BundleProblem features = EstimateFeatures(round);
      TakeAssociations(
          TestAssociations(model_, selection_, features, round > 0, options_.gate_confidence));
      if (round + 1 == options_.gate_rounds) break;
      BundleProblem all = Build();
      AnnealAndSolve(Short(), &all.problem);
      WriteBack(all, &model_);
    }
  }
  // Features as seen, at the cameras of the round: without the pull of what is to be tested.
  BundleProblem EstimateFeatures(int round) {
    BundleSelection cameras_held = selection_;
    cameras_held.HoldCameras();
    BundleProblem features = BuildFeatures(cameras_held);
    scales_.Begin(features.problem);
    if (round > 0) Solve(Short(), &features.problem);
    return features;
  }
  void TakeAssociations(AssociationReport report) {
    if (!options_.fix_groups) {
      for (auto& [id, params] : report.group_params) model_.groups3D.at(id).params = params;
    }
    LogReport(report);
    summary_.associations = std::move(report.counts);
    summary_.groups_dropped = report.groups_dropped;
    summary_.filter = std::move(report.filter);
  }

  // What moves the cameras, by what the cameras then predict.
  void ChooseWeights() {
    if (stopped_) return;
    const auto solve = [&](int num_iterations, Problem* problem) {
      Solve(StepsFromNear(solver_options_, num_iterations), problem);
      return !stopped_;
    };
    summary_.weight_choice = holba::ChooseWeights(
        {options_, selection_, measurements_, summary_.filter, scales_.scales().at("point"),
         solver_options_.num_threads, &scales_, solve},
        &model_);
    LogChoice();
  }

  // Everything with the associations that passed, to convergence: the cameras with the weights that
  // were chosen; then, where these are others, all the rest on these cameras with the weights as
  // given.
  BundleProblem AdjustAll() {
    const WeightChoice& choice = summary_.weight_choice;
    if (!choice.IsAsGiven()) {
      AdjustCameras(choice);
      selection_.HoldCameras();
    }
    // The summary's reduced system is that of the cameras.
    const ReducedSystem of_cameras = summary_.solver.reduced_system;
    BundleProblem bundle = Build();
    AnnealAndSolve(solver_options_, &bundle.problem);
    if (!choice.IsAsGiven()) summary_.solver.reduced_system = of_cameras;
    return bundle;
  }

  void AdjustCameras(const WeightChoice& choice) {
    if (stopped_) return;
    BundleOptions options = options_;
    if (choice.weights.points_alone) options.config = BundleConfig::kPoint;
    BundleProblem bundle =
        BuildProblem(model_, options, SelectionOfCameras(model_, choice, selection_), measurements_,
                     &summary_.filter);
    scales_.Begin(bundle.problem);
    scales_.Weigh(choice.weights.structure);
    Solve(solver_options_, &bundle.problem);
    WriteBack(bundle, &model_);
    CountSensors(bundle);
    scales_.Weigh({});
    scales_.Leave();
  }

  // In the problem that moves the cameras; none moves in one that holds them.
  void CountSensors(const BundleProblem& bundle) {
    for (const auto& [sensor, block] : bundle.sensors)
      summary_.num_sensors += bundle.problem.block(block).IsVariable();
  }

  void Summarise(const std::vector<double>& start, BundleProblem* bundle) {
    SolverSummary& solver = summary_.solver;
    if (stopped_) SetTerms(bundle->problem, &solver.final_terms, &solver.final_cost);
    summary_.auto_scales = scales_.scales();
    summary_.auto_sigmas = scales_.sigmas();
    summary_.angular_weight_factor = scales_.AngularFactor();
    summary_.num_parts = 1 + selection_.gauges_of_other_parts.size();
    CountSensors(*bundle);
    summary_.points_seen_once = selection_.points_seen_once.size();
    summary_.lines_seen_once = selection_.lines_seen_once.size();
    summary_.structure_point_weight_factor = scales_.StructurePointFactor();
    // Costs before, with the losses and associations of the end.
    bundle->problem.state() = start;
    SetTerms(bundle->problem, &solver.initial_terms, &solver.initial_cost);
  }

  void LogReport(const AssociationReport& report) const {
    if (!log_) return;
    std::string text;
    for (const auto& [kind, count] : report.counts) {
      text += fmt::format("{} {} of {} {}", text.empty() ? "" : ",", count.rejected, count.tested,
                          kind);
    }
    log_(fmt::format("Associations left out:{}; with them {}", text,
                     Counted(report.groups_dropped, "whole group")));
  }

  void LogChoice() const {
    if (!log_ || summary_.weight_choice.trials.empty()) return;
    for (const WeightTrial& trial : summary_.weight_choice.trials) {
      log_(fmt::format("Points left out cost {:+.4f} +- {:.4f} with {}", trial.from_points.mean,
                       trial.from_points.standard_error, trial.weights.Text()));
    }
    log_(fmt::format("Cameras are moved by {}", summary_.weight_choice.weights.Text()));
  }

  SolverOptions Short() const {
    SolverOptions options = solver_options_;
    options.analyse_reduced_system = false;
    options.max_num_iterations = std::min(kRoundIterations, options.max_num_iterations);
    options.function_tolerance = std::max(kRoundTolerance, options.function_tolerance);
    return options;
  }

  // Rounds of Cauchy whose scales are measured and tightened, then one with `last`.
  void AnnealAndSolve(const SolverOptions& last, Problem* problem) {
    if (scales_.Begin(*problem)) Anneal(problem);
    if (!stopped_) Solve(last, problem);
  }
  void Anneal(Problem* problem) {
    for (int round = 0; round < kMaxRounds && !stopped_; ++round) {
      if (log_) log_(fmt::format("Scales of the Cauchy losses:{}", scales_.Text()));
      Solve(Short(), problem);
      if (scales_.Tighten(*problem)) break;
    }
  }

  void Solve(SolverOptions options, Problem* problem) {
    options.max_seconds = std::max(solver_options_.max_seconds - timer_.Seconds(), 0.0);
    const SolverSummary solved = holba::Solve(options, problem, &workspace_);
    stopped_ |=
        solved.stop_reason == StopReason::kCallback || solved.stop_reason == StopReason::kMaxTime;
    Accumulate(solved, &summary_.solver);
    ++summary_.rounds;
  }

  const BundleOptions& options_;
  const SolverOptions& solver_options_;
  BundleSelection selection_;
  Reconstruction& model_;
  std::span<const GroupMeasurement> measurements_;
  const RoundLog& log_;
  const Timer timer_;
  AutoScales scales_;
  SolverWorkspace workspace_;  // many rounds are of one structure
  BundleSummary summary_;
  bool stopped_ = false;  // by the caller, or because time is up
};

// Estimates what the configuration left out, with everything that took part held: first lines on
// their own, then groups on the features as they are.
void RefitOthers(BundleOptions options, SolverOptions solver_options, BundleSelection selection,
                 const NoiseSigmas& known, Reconstruction* model) {
  const bool lines =
      options.config < BundleConfig::kPointLine && !selection.lines.empty() && !options.fix_lines;
  const bool groups =
      options.config < BundleConfig::kGroups && !selection.groups.empty() && !options.fix_groups;
  solver_options.on_iteration = nullptr;
  selection.HoldCameras();
  selection.HoldPoints();
  if (lines) {
    options.config = BundleConfig::kPointLine;
    Adjuster(options, solver_options, selection, model, {}, {}, known).Run();
  }
  if (groups) {
    options.config = BundleConfig::kGroups;
    selection.HoldLines();
    Adjuster(options, solver_options, selection, model, {}, {}, known).Run();
  }
}

// In the frame that the model is in.
BundleSummary AdjustInPlace(const BundleOptions& given, const SolverOptions& solver_options,
                            const BundleSelection& selection, Reconstruction* model,
                            std::span<const GroupMeasurement> measurements, const RoundLog& log,
                            const NoiseSigmas& known) {
  BundleOptions options = given;
  options.SetDefaultLosses(false);
  options.RememberPrincipalPoints(*model);
  BundleSummary summary =
      Adjuster(options, solver_options, selection, model, measurements, log, known).Run();
  if (options.refit_others) RefitOthers(options, solver_options, selection, known, model);
  UpdateErrors(selection, model);
  return summary;
}

}  // namespace

BundleSummary AdjustBundle(const BundleOptions& options, const SolverOptions& solver_options,
                           Reconstruction* model, std::span<const GroupMeasurement> measurements,
                           const RoundLog& log, const NoiseSigmas& known) {
  const Timer timer;
  BundleSummary summary;
  {
    const LocalFrame local(model, FrameUnit(options));
    std::vector<CameraSharingTrial> shared_cameras;
    if (options.share_cameras)
      shared_cameras = ShareCameras(options, solver_options, known, log, model);
    std::vector<CameraModelTrial> camera_models;
    if (options.camera_model == CameraModelSource::kAuto)
      camera_models = ChooseCameraModels(options, solver_options, known, log, model);
    const BundleSelection everything = BundleSelection::Everything(*model, options);
    summary = AdjustInPlace(options, solver_options, everything, model, measurements, log, known);
    summary.shared_cameras = std::move(shared_cameras);
    summary.camera_models = std::move(camera_models);
  }
  summary.solver.total_seconds = timer.Seconds();
  return summary;
}

BundleSummary AdjustBundle(const BundleOptions& options, const SolverOptions& solver_options,
                           const BundleSelection& selection, Reconstruction* model,
                           std::span<const GroupMeasurement> measurements, const RoundLog& log,
                           const NoiseSigmas& known) {
  const Timer timer;
  BundleSummary summary;
  {
    const LocalFrame local(model, FrameUnit(options));
    summary = AdjustInPlace(options, solver_options, selection, model, measurements, log, known);
  }
  summary.solver.total_seconds = timer.Seconds();
  return summary;
}

LocalFrame::Unit FrameUnit(const BundleOptions& options) {
  const bool has_3d_form =
      options.group_form == StructureForm::k3d || options.wireframe_form == StructureForm::k3d;
  return has_3d_form ? LocalFrame::Unit::kUnchanged : LocalFrame::Unit::kOfTheScene;
}

std::vector<TermCost> EvaluateModel(const Reconstruction& model,
                                    std::span<const GroupMeasurement> measurements) {
  // Everything is counted, also what a single image sees: nothing has to be estimated.
  BundleOptions options;
  options.fix_points = options.fix_lines = true;
  const BundleProblem bundle = BuildProblem(model, options, measurements);
  const std::vector<TermCost> found = EvaluateTerms(bundle.problem);
  std::vector<TermCost> terms;
  for (const Term& term : kTerms) {
    const auto it = std::find_if(found.begin(), found.end(),
                                 [&](const TermCost& t) { return t.term == term.name; });
    if (it != found.end()) {
      terms.push_back(*it);
    } else if (term.in_format) {
      terms.push_back({std::string(term.name)});
    }
  }
  return terms;
}

}  // namespace holba
