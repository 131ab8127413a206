// SPDX-License-Identifier: BSD-3-Clause
#include "holba/bundle/adjust_bundle.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <set>

#include "holba/base/timer.h"
#include "holba/bundle/bundle_problem.h"
#include "holba/bundle/camera_shift.h"
#include "holba/scene/selection.h"

namespace holba {
namespace {

// Median of |x| of a normal distribution is 0.6745 sigma.
constexpr double kSigmaPerMedian = 1.4826;
// Scales that differ less than this are the same.
constexpr double kScaleTolerance = 0.02;
// Sine of 0.01 degrees: no direction is known better.
constexpr double kMinAngularScale = 1.7e-4;
constexpr int kMaxRounds = 12;
// A round before the last need not converge: it only has to bring the residuals near.
constexpr int kRoundIterations = 15;
constexpr double kRoundTolerance = 1e-4;
// Above so many frames the cameras' covariances cost more than the adjustment.
constexpr size_t kMaxFramesOfReference = 2000;

double Median(std::vector<double>* values) {
  if (values->empty()) return 0.0;
  const auto middle = values->begin() + values->size() / 2;
  std::nth_element(values->begin(), middle, values->end());
  return *middle;
}

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

// Terms whose loss scale is measured, and the weight of angular terms, which follows the noise in
// pixels: cost in px^2 is noise^2 times a chi-square, so a variance in an angle needs that factor
// to weigh what it says. Scales outlive a problem: the next one begins where the last ended.
class AutoScales {
 public:
  explicit AutoScales(const BundleOptions& options)
      : options_(options), sigmas_(options.known_auto_sigmas) {
    for (const auto& [term, sigma] : sigmas_) scales_[term] = GoalOf(term, sigma);
  }

  // Sets the losses of a new problem. True: some scale is new and has to be annealed.
  bool Begin(const Problem& problem) {
    bool fresh = false;
    terms_.clear();
    angular_.clear();
    structure_points_.clear();
    for (const auto& batch : problem.batches()) {
      const std::string& term = batch->term();
      if (batch->angular) angular_.emplace_back(batch.get(), batch->weight);
      if (term == "structure_point") structure_points_.emplace_back(batch.get(), batch->weight);
      if (options_[FamilyOf(term)].loss != LossChoice::kAuto || term.ends_with("_3d") ||
          terms_.contains(term))
        continue;
      terms_.insert(term);
      if (scales_.contains(term)) continue;
      fresh = true;
      scales_[term] = options_.auto_start_multiple * Goal(problem, term);
    }
    Apply(problem);
    return fresh;
  }
  bool empty() const { return terms_.empty(); }

  // Halves the scales towards their goals. True: they had arrived.
  bool Tighten(const Problem& problem) {
    bool arrived = true;
    for (const std::string& term : terms_) {
      double& scale = scales_[term];
      const double next = std::max(Goal(problem, term), 0.5 * scale);
      if (std::abs(next - scale) > kScaleTolerance * scale) arrived = false;
      scale = next;
    }
    Apply(problem);
    return arrived;
  }
  const std::map<std::string, double>& scales() const { return scales_; }
  const std::map<std::string, double>& sigmas() const { return sigmas_; }
  std::string Text() const {
    std::string text;
    for (const std::string& term : terms_) {
      text += fmt::format("{} {} {:.3f} px", text.empty() ? "" : ",", term, scales_.at(term));
    }
    return text;
  }
  void Apply(const Problem& problem) const {
    for (const auto& batch : problem.batches()) {
      if (terms_.contains(batch->term()))
        batch->loss = {LossType::kCauchy, scales_.at(batch->term())};
    }
    for (const auto& [batch, weight] : angular_) batch->weight = AngularFactor() * weight;
    for (const auto& [batch, weight] : structure_points_)
      batch->weight = StructurePointFactor() * weight;
  }
  // Variance of the noise of one coordinate, px^2, where it is measured; 1: the weights of angular
  // terms as they are.
  double AngularFactor() const {
    for (const char* term : {"point", "line"}) {
      const auto sigma = sigmas_.find(term);
      if (sigma == sigmas_.end()) continue;
      const double least = options_.auto_min_scale_px / options_.auto_num_sigmas;
      return std::pow(std::max(sigma->second, least), 2);
    }
    return 1.0;
  }
  // Variance of the noise of points by that of points of structure, where both are measured: what
  // is placed worse weighs less.
  double StructurePointFactor() const {
    const auto points = sigmas_.find("point"), of_structure = sigmas_.find("structure_point");
    if (points == sigmas_.end() || of_structure == sigmas_.end()) return 1.0;
    if (!(of_structure->second > points->second)) return 1.0;
    return std::pow(points->second / of_structure->second, 2);
  }

 private:
  double Goal(const Problem& problem, const std::string& term) {
    const double sigma = RobustSigma(problem, term);
    sigmas_[term] = sigma;
    return GoalOf(term, sigma);
  }
  double GoalOf(const std::string& term, double sigma) const {
    return std::max(options_.auto_num_sigmas * sigma,
                    IsAngular(FamilyOf(term)) ? kMinAngularScale : options_.auto_min_scale_px);
  }

  const BundleOptions& options_;
  std::set<std::string> terms_;                             // of the problem at hand
  std::vector<std::pair<ResidualBatch*, double>> angular_;  // of it, with their weights as given
  std::vector<std::pair<ResidualBatch*, double>> structure_points_;
  std::map<std::string, double> scales_;
  std::map<std::string, double> sigmas_;
};

// Estimates what the configuration left out, with everything that took part held: first lines on
// their own, then groups on the features as they are.
void RefitOthers(BundleOptions options, SolverOptions solver_options, Reconstruction* model) {
  const bool lines =
      options.config < BundleConfig::kPointLine && !model->lines3D.empty() && !options.fix_lines;
  const bool groups =
      options.config < BundleConfig::kGroups && !model->groups3D.empty() && !options.fix_groups;
  solver_options.on_iteration = nullptr;
  options.refit_others = false;
  options.fix_poses = options.fix_points = true;
  options.refine_focal_length = options.refine_principal_point = options.refine_extra_params =
      false;
  if (lines) {
    options.config = BundleConfig::kPointLine;
    AdjustBundle(options, solver_options, model);
  }
  if (groups) {
    options.config = BundleConfig::kGroups;
    options.fix_lines = true;
    AdjustBundle(options, solver_options, model);
  }
}

}  // namespace

double RobustSigma(const Problem& problem, const std::string& term) {
  std::vector<double> values = ResidualNorms(problem, term, true);
  if (term == "line" || term == "group_line") {
    // Perpendicular vectors, two components each: their length is the distance.
    for (size_t i = 0; i + 1 < values.size(); i += 2)
      values[i / 2] = std::hypot(values[i], values[i + 1]);
    values.resize(values.size() / 2);
  }
  return kSigmaPerMedian * Median(&values);
}

namespace {

// One adjustment: its rounds share loss scales, log and summary.
class Adjuster {
 public:
  Adjuster(const BundleOptions& options, const SolverOptions& solver_options, Reconstruction* model,
           std::span<const GroupMeasurement> measurements, const RoundLog& log)
      : options_(options),
        solver_options_(solver_options),
        model_(*model),
        measurements_(measurements),
        log_(log),
        scales_(options_) {}

  BundleSummary Run() {
    const std::vector<double> start = BuildProblem(model_, options_, measurements_).problem.state();
    SetReference();
    AssociationFilter filter;
    if (HasAssociations()) {
      AdjustLines();
      filter = Gate();
    }
    const auto adjust = [&] {
      BundleProblem bundle = BuildProblem(model_, options_, measurements_, &filter);
      Anneal(&bundle.problem);
      if (!stopped_) Solve(solver_options_, &bundle.problem);
      return bundle;
    };
    BundleProblem bundle = adjust();
    if (Contradicts(bundle)) {
      HoldCameras();
      bundle = adjust();
    }
    if (stopped_)
      SetTerms(bundle.problem, &summary_.solver.final_terms, &summary_.solver.final_cost);
    WriteBack(bundle, &model_);

    summary_.filter = std::move(filter);
    summary_.auto_scales = scales_.scales();
    summary_.auto_sigmas = scales_.sigmas();
    summary_.angular_weight_factor = scales_.AngularFactor();
    summary_.structure_point_weight_factor = scales_.StructurePointFactor();
    // Costs before, with the losses and associations of the end.
    bundle.problem.state() = start;
    SetTerms(bundle.problem, &summary_.solver.initial_terms, &summary_.solver.initial_cost);
    return std::move(summary_);
  }

 private:
  static void SetTerms(const Problem& problem, std::vector<TermCost>* terms, double* cost) {
    *terms = EvaluateTerms(problem);
    *cost = 0.0;
    for (const TermCost& term : *terms) *cost += term.cost;
  }

  bool HasAssociations() const {
    return options_.gate && options_.config >= BundleConfig::kGroups &&
           (!model_.groups3D.empty() || !model_.wireframe.empty());
  }

  // Points alone, where that says how sure the cameras are and something else could move them.
  void SetReference() {
    if (options_.max_camera_shift_sigmas <= 0.0 || options_.config == BundleConfig::kPoint ||
        options_.fix_poses || options_.fix_points || options_.gauge != Gauge::kTwoCams ||
        model_.points3D.empty() || model_.frames.size() > kMaxFramesOfReference)
      return;
    BundleOptions points_only = options_;
    points_only.config = BundleConfig::kPoint;
    const Reconstruction alone = Select(
        model_,
        {.keep_point = [&](point3D_t id,
                           const Point3D&) { return !options_.points_of_structure.contains(id); },
         .keep_line = {},
         .keep_group = {}});
    BundleProblem bundle = BuildProblem(alone, points_only);
    Anneal(&bundle.problem);
    if (!stopped_) Solve(solver_options_, &bundle.problem);
    if (stopped_) return;
    std::optional<CameraReference> reference =
        CameraReference::Of(bundle, solver_options_.num_threads, &workspace_);
    if (!reference) return;
    WriteBack(bundle, &model_);
    points_alone_.emplace(std::move(bundle));
    reference_ = std::move(reference);
  }

  // Whether a problem's cameras are farther from those of points alone than these are uncertain.
  bool Contradicts(const BundleProblem& bundle) {
    if (!reference_ || stopped_) return false;
    summary_.camera_shift_sigmas = reference_->ShiftSigmas(bundle);
    if (log_) {
      log_(fmt::format("Cameras moved by {:.2f} of their standard deviations from points alone",
                       *summary_.camera_shift_sigmas));
    }
    return *summary_.camera_shift_sigmas > options_.max_camera_shift_sigmas;
  }

  // Back to the cameras (and points) of points alone; there they stay. Not to those of points and
  // lines, where these passed: less information has less to contradict with.
  void HoldCameras() {
    WriteBack(*points_alone_, &model_);
    options_.fix_poses = true;
    options_.refine_focal_length = options_.refine_principal_point = options_.refine_extra_params =
        false;
    summary_.cameras_held = true;
    reference_.reset();
    if (log_) log_("They contradict the points: the cameras stay");
  }

  // Points and lines alone.
  void AdjustLines() {
    BundleOptions features_only = options_;
    features_only.config = BundleConfig::kPointLine;
    BundleProblem bundle = BuildProblem(model_, features_only);
    Anneal(&bundle.problem);
    if (!stopped_) Solve(solver_options_, &bundle.problem);
    if (Contradicts(bundle)) {
      HoldCameras();
      AdjustLines();
      return;
    }
    WriteBack(bundle, &model_);
  }

  // Rounds of testing and adjusting. Leaves the model near the optimum of the associations that it
  // returns.
  AssociationFilter Gate() {
    BundleOptions features_only = options_;
    features_only.config = BundleConfig::kPointLine;
    // Features as seen, at the cameras of the round: without the pull of what is to be tested.
    features_only.fix_poses = true;
    features_only.refine_focal_length = features_only.refine_principal_point =
        features_only.refine_extra_params = false;
    AssociationReport report;
    for (int round = 0; round < options_.gate_rounds && !stopped_; ++round) {
      BundleProblem features = BuildProblem(model_, features_only);
      scales_.Begin(features.problem);
      if (round > 0) Solve(Short(), &features.problem);
      report = TestAssociations(model_, features, options_.gate_confidence);
      if (!options_.fix_groups) {
        for (auto& [id, params] : report.group_params) model_.groups3D.at(id).params = params;
      }
      LogReport(report);
      if (round + 1 == options_.gate_rounds) break;
      BundleProblem all = BuildProblem(model_, options_, measurements_, &report.filter);
      Anneal(&all.problem);
      if (!stopped_) Solve(Short(), &all.problem);
      WriteBack(all, &model_);
    }
    summary_.associations = report.counts;
    summary_.groups_dropped = report.groups_dropped;
    return report.filter;
  }

  void LogReport(const AssociationReport& report) const {
    if (!log_) return;
    std::string text;
    for (const auto& [kind, count] : report.counts) {
      text += fmt::format("{} {} of {} {}", text.empty() ? "" : ",", count.rejected, count.tested,
                          kind);
    }
    log_(fmt::format("Associations left out:{}; groups: {}", text, report.groups_dropped));
  }

  SolverOptions Short() const {
    SolverOptions options = solver_options_;
    options.analyse_reduced_system = false;
    options.max_num_iterations = std::min(kRoundIterations, options.max_num_iterations);
    options.function_tolerance = std::max(kRoundTolerance, options.function_tolerance);
    return options;
  }

  void Anneal(Problem* problem) {
    if (!scales_.Begin(*problem)) return;
    for (int round = 0; round < kMaxRounds && !stopped_; ++round) {
      if (log_) log_(fmt::format("Cauchy scales:{}", scales_.Text()));
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

  BundleOptions options_;
  const SolverOptions& solver_options_;
  Reconstruction& model_;
  std::span<const GroupMeasurement> measurements_;
  const RoundLog& log_;
  const Timer timer_;
  AutoScales scales_;
  SolverWorkspace workspace_;  // many rounds are of one structure
  BundleSummary summary_;
  std::optional<CameraReference> reference_;
  std::optional<BundleProblem> points_alone_;  // that it is of
  bool stopped_ = false;                       // by the caller, or because time is up
};

}  // namespace

BundleSummary AdjustBundle(const BundleOptions& given, const SolverOptions& solver_options,
                           Reconstruction* model, std::span<const GroupMeasurement> measurements,
                           const RoundLog& log) {
  const Timer timer;
  BundleOptions options = given;
  options.SetDefaultLosses(false);
  BundleSummary summary = Adjuster(options, solver_options, model, measurements, log).Run();
  if (options.refit_others) RefitOthers(options, solver_options, model);
  UpdateErrors(model);
  summary.solver.total_seconds = timer.Seconds();
  return summary;
}

std::vector<TermCost> EvaluateModel(const Reconstruction& model,
                                    std::span<const GroupMeasurement> measurements) {
  const BundleProblem bundle = BuildProblem(model, BundleOptions(), measurements);
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
