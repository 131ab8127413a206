// SPDX-License-Identifier: BSD-3-Clause
#include "holba/bundle/adjust_bundle.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "holba/base/timer.h"
#include "holba/bundle/bundle_problem.h"

namespace holba {
namespace {

// Median of |x| of a normal distribution is 0.6745 sigma.
constexpr double kSigmaPerMedian = 1.4826;
// Annealing starts at this multiple of the goal and halves: wide enough to keep what the start has wrong.
constexpr double kStartMultiple = 8.0;
// Scales that differ less than this are the same.
constexpr double kScaleTolerance = 0.02;
constexpr int kMaxRounds = 12;
// A round before the last need not converge: it only has to bring the residuals near.
constexpr int kRoundIterations = 15;
constexpr double kRoundTolerance = 1e-4;

double Median(std::vector<double>* values) {
  if (values->empty()) return 0.0;
  const auto middle = values->begin() + values->size() / 2;
  std::nth_element(values->begin(), middle, values->end());
  return *middle;
}

TermFamily FamilyOf(const std::string& term) {
  if (term == "point") return TermFamily::kPoint;
  if (term == "line") return TermFamily::kLine;
  if (term.starts_with("group_point") || term.starts_with("group_line")) return TermFamily::kGroup;
  if (term.starts_with("wireframe")) return TermFamily::kWireframe;
  if (term == "vp") return TermFamily::kVp;
  if (term == "relation") return TermFamily::kRelation;
  return TermFamily::kMeasurement;
}

void Accumulate(const SolverSummary& round, SolverSummary* sum) {
  SolverSummary merged = round;
  merged.iterations += sum->iterations;
  merged.accepted_steps += sum->accepted_steps;
  merged.build_seconds += sum->build_seconds;
  merged.linearise_seconds += sum->linearise_seconds;
  merged.eliminate_seconds += sum->eliminate_seconds;
  merged.total_seconds += sum->total_seconds;
  merged.iteration_seconds.insert(merged.iteration_seconds.begin(), sum->iteration_seconds.begin(),
                                  sum->iteration_seconds.end());
  *sum = std::move(merged);
}

// Terms whose loss scale is measured.
class AutoScales {
 public:
  AutoScales(const BundleOptions& options, const Problem& problem) : options_(options) {
    for (const auto& batch : problem.batches()) {
      const TermFamily family = FamilyOf(batch->term());
      if (options[family].loss == LossChoice::kAuto && !batch->term().ends_with("_3d")) scales_[batch->term()] = 0.0;
    }
    for (auto& [term, scale] : scales_) scale = kStartMultiple * Goal(problem, term);
    Apply(problem);
  }
  bool empty() const { return scales_.empty(); }

  // Halves the scales towards their goals. True: they had arrived.
  bool Tighten(const Problem& problem) {
    bool arrived = true;
    for (auto& [term, scale] : scales_) {
      const double next = std::max(Goal(problem, term), 0.5 * scale);
      if (std::abs(next - scale) > kScaleTolerance * scale) arrived = false;
      scale = next;
    }
    Apply(problem);
    return arrived;
  }
  // Whether the next Tighten reaches the goals as they look now.
  bool Near(const Problem& problem) const {
    for (const auto& [term, scale] : scales_) {
      if (scale > 1.05 * Goal(problem, term)) return false;
    }
    return true;
  }
  const std::map<std::string, double>& scales() const { return scales_; }
  const std::map<std::string, double>& sigmas() const { return sigmas_; }
  std::string Text() const {
    std::string text;
    for (const auto& [term, scale] : scales_) text += fmt::format(" {} {:.3f} px,", term, scale);
    if (!text.empty()) text.pop_back();
    return text;
  }

 private:
  double Goal(const Problem& problem, const std::string& term) {
    sigmas_[term] = RobustSigmaPx(problem, term);
    return std::max(options_.auto_num_sigmas * sigmas_[term], options_.auto_min_scale_px);
  }
  double Goal(const Problem& problem, const std::string& term) const {
    return std::max(options_.auto_num_sigmas * RobustSigmaPx(problem, term), options_.auto_min_scale_px);
  }
  void Apply(const Problem& problem) {
    for (const auto& batch : problem.batches()) {
      const auto it = scales_.find(batch->term());
      if (it != scales_.end()) batch->loss = {LossType::kCauchy, it->second};
    }
  }

  const BundleOptions& options_;
  std::map<std::string, double> scales_;
  std::map<std::string, double> sigmas_;
};

// Estimates what the configuration left out, with everything that took part held: first lines on their own, then
// groups on the features as they are.
void RefitOthers(BundleOptions options, SolverOptions solver_options, Reconstruction* model) {
  const bool lines = options.config < BundleConfig::kPointLine && !model->lines3D.empty() && !options.fix_lines;
  const bool groups = options.config < BundleConfig::kGroups && !model->groups3D.empty() && !options.fix_groups;
  solver_options.on_iteration = nullptr;
  options.refit_others = false;
  options.fix_poses = options.fix_points = true;
  options.refine_focal_length = options.refine_principal_point = options.refine_extra_params = false;
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

double RobustSigmaPx(const Problem& problem, const std::string& term) {
  std::vector<double> values = ResidualNorms(problem, term, true);
  if (term == "line" || term == "group_line") {
    // Perpendicular vectors, two components each: their length is the distance.
    for (size_t i = 0; i + 1 < values.size(); i += 2) values[i / 2] = std::hypot(values[i], values[i + 1]);
    values.resize(values.size() / 2);
  }
  return kSigmaPerMedian * Median(&values);
}

BundleSummary AdjustBundle(const BundleOptions& given, const SolverOptions& solver_options, Reconstruction* model,
                           std::span<const GroupMeasurement> measurements, const RoundLog& log) {
  BundleOptions options = given;
  options.SetDefaultLosses(false);
  const Timer timer;
  BundleProblem bundle = BuildProblem(*model, options, measurements);
  Problem& problem = bundle.problem;
  const std::vector<double> start = problem.state();
  AutoScales scales(options, problem);
  BundleSummary summary;
  summary.solver.build_seconds = timer.Seconds();

  if (!scales.empty()) {
    SolverOptions round_options = solver_options;
    round_options.max_num_iterations = std::min(kRoundIterations, solver_options.max_num_iterations);
    round_options.function_tolerance = std::max(kRoundTolerance, solver_options.function_tolerance);
    for (int round = 0; round < kMaxRounds; ++round) {
      if (log) log(fmt::format("Round {}: Cauchy scales{}", round + 1, scales.Text()));
      const SolverSummary solved = Solve(round_options, &problem);
      Accumulate(solved, &summary.solver);
      ++summary.rounds;
      if (solved.stop_reason == StopReason::kCallback || scales.Tighten(problem)) break;
    }
    if (log) log(fmt::format("Last round: Cauchy scales{}", scales.Text()));
  }
  if (summary.solver.stop_reason != StopReason::kCallback) {
    Accumulate(Solve(solver_options, &problem), &summary.solver);
  }

  summary.auto_scales_px = scales.scales();
  summary.auto_sigmas_px = scales.sigmas();
  if (summary.rounds > 1) {
    // Costs before and after with the same losses.
    std::vector<double> end = start;
    problem.state().swap(end);
    summary.solver.initial_terms = EvaluateTerms(problem);
    problem.state().swap(end);
    summary.solver.initial_cost = 0.0;
    for (const TermCost& term : summary.solver.initial_terms) summary.solver.initial_cost += term.cost;
  }
  WriteBack(bundle, model);
  if (options.refit_others) RefitOthers(options, solver_options, model);
  UpdateErrors(model);
  summary.solver.total_seconds = timer.Seconds();
  return summary;
}

std::vector<TermCost> EvaluateModel(const Reconstruction& model, std::span<const GroupMeasurement> measurements) {
  const BundleProblem bundle = BuildProblem(model, BundleOptions(), measurements);
  const std::vector<TermCost> found = EvaluateTerms(bundle.problem);
  std::vector<TermCost> terms;
  for (const char* name : {"point", "line", "group_point", "group_line", "vp", "wireframe_point", "wireframe_line",
                           "relation", "group_measurement"}) {
    const auto it = std::find_if(found.begin(), found.end(), [&](const TermCost& t) { return t.term == name; });
    if (it != found.end()) {
      terms.push_back(*it);
    } else if (std::string_view(name) != "group_measurement") {
      terms.push_back({name});
    }
  }
  return terms;
}

}  // namespace holba
