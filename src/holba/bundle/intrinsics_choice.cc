// SPDX-License-Identifier: BSD-3-Clause
#include "holba/bundle/intrinsics_choice.h"

#include <vector>

#include "holba/bundle/bundle_problem.h"
#include "holba/bundle/bundle_selection.h"

namespace holba {
namespace {

// Each fold begins at the optimum of all points.
constexpr int kIterations = 8;

std::vector<double> Costs(const AdjustedPoints& points, const HeldOutPoints& held_out, size_t fold,
                          const NoiseSigmas& sigmas, const SolverOptions& solver) {
  BundleOptions options = points.options;
  options.config = BundleConfig::kPoint;
  AutoScales scales(options, sigmas);
  BundleProblem bundle =
      BuildProblem(points.model, options,
                   held_out.Without(fold, BundleSelection::Everything(points.model, options)));
  scales.Begin(bundle.problem);
  Solve(StepsFromNear(solver, kIterations), &bundle.problem);
  Reconstruction adjusted = points.model;
  WriteBack(bundle, &adjusted);
  return held_out.PredictionCosts(fold, adjusted, scales.scales().at("point"), solver.num_threads);
}

}  // namespace

std::optional<BundleOptions> PointsAlone(const BundleOptions& given) {
  BundleOptions options = given;
  options.config = BundleConfig::kPoint;
  options.camera_model = CameraModelSource::kGiven;
  options.share_cameras = false;
  options.refit_others = false;
  options.SetDefaultLosses(false);
  if (options[TermFamily::kPoint].loss != LossChoice::kAuto) return std::nullopt;
  // What points were made with is not known: the annealing begins far out.
  options.auto_start_multiple = BundleOptions().auto_start_multiple;
  return options;
}

PairedMean ComparePredictions(const AdjustedPoints& free, const AdjustedPoints& held,
                              const NoiseSigmas& sigmas, const SolverOptions& solver_options) {
  const HeldOutPoints held_out(free.model, BundleSelection::Everything(free.model, free.options));
  std::vector<double> costs_free, costs_held;
  for (size_t fold = 0; fold < HeldOutPoints::kNumFolds; ++fold) {
    const auto append = [&](const AdjustedPoints& points, std::vector<double>* costs) {
      const auto found = Costs(points, held_out, fold, sigmas, solver_options);
      costs->insert(costs->end(), found.begin(), found.end());
    };
    append(free, &costs_free);
    append(held, &costs_held);
  }
  return costs_free.size() > 1 ? MeanDifference(costs_free, costs_held) : PairedMean{};
}

}  // namespace holba
