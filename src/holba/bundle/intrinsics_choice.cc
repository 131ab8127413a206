// SPDX-License-Identifier: BSD-3-Clause
#include "holba/bundle/intrinsics_choice.h"

#include <Eigen/Core>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <utility>
#include <vector>

#include "holba/bundle/bundle_problem.h"
#include "holba/bundle/bundle_selection.h"

namespace holba {
namespace {

// Each fold begins at the optimum of all points; half of the images are further from theirs.
constexpr int kIterations = 8;
constexpr int kIterationsOfHalf = 20;

// Adjusts a part of a model's points with the noise that is known. Returns the scale of their loss,
// px.
double AdjustPart(const BundleOptions& options, const BundleSelection& part,
                  const NoiseSigmas& sigmas, const SolverOptions& solver, Reconstruction* model) {
  AutoScales scales(options, sigmas);
  BundleProblem bundle = BuildProblem(*model, options, part);
  scales.Begin(bundle.problem);
  Solve(solver, &bundle.problem);
  WriteBack(bundle, model);
  return scales.scales().at("point");
}

// What it costs a model whose points are `start` to predict the points of a fold that a part leaves
// out.
std::vector<double> Costs(const BundleOptions& options, const Reconstruction& start,
                          const BundleSelection& part, const HeldOutPoints& held_out, size_t fold,
                          const NoiseSigmas& sigmas, const SolverOptions& solver) {
  Reconstruction adjusted = start;
  const double scale_px = AdjustPart(options, held_out.Without(fold, part), sigmas,
                                     StepsFromNear(solver, kIterations), &adjusted);
  return held_out.PredictionCosts(fold, adjusted, scale_px, solver.num_threads);
}

BundleOptions OfPoints(BundleOptions options) {
  options.config = BundleConfig::kPoint;
  return options;
}

// Images on both sides of the plane across the widest spread of the camera centres that has as many
// on each.
std::array<std::vector<image_t>, 2> HalvesOf(const Reconstruction& model) {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const auto& [id, image] : model.images) mean += image.cam_from_world.OriginInA();
  mean /= static_cast<double>(model.images.size());
  Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
  for (const auto& [id, image] : model.images) {
    const Eigen::Vector3d offset = image.cam_from_world.OriginInA() - mean;
    scatter += offset * offset.transpose();
  }
  const Eigen::Vector3d axis =
      Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(scatter).eigenvectors().col(2);
  std::vector<std::pair<double, image_t>> along;
  for (const auto& [id, image] : model.images)
    along.emplace_back(axis.dot(image.cam_from_world.OriginInA() - mean), id);
  std::sort(along.begin(), along.end());
  std::array<std::vector<image_t>, 2> halves;
  for (size_t i = 0; i < along.size(); ++i)
    halves[i < along.size() / 2 ? 0 : 1].push_back(along[i].second);
  return halves;
}

PairedMean MeanOf(const std::vector<double>& costs_free, const std::vector<double>& costs_held) {
  return costs_free.size() > 1 ? MeanDifference(costs_free, costs_held) : PairedMean{};
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
  const auto append = [&](const AdjustedPoints& points, size_t fold, std::vector<double>* costs) {
    const BundleOptions options = OfPoints(points.options);
    const auto found =
        Costs(options, points.model, BundleSelection::Everything(points.model, options), held_out,
              fold, sigmas, solver_options);
    costs->insert(costs->end(), found.begin(), found.end());
  };
  for (size_t fold = 0; fold < HeldOutPoints::kNumFolds; ++fold) {
    append(free, fold, &costs_free);
    append(held, fold, &costs_held);
  }
  return MeanOf(costs_free, costs_held);
}

PairedMean CompareCarried(const AdjustedPoints& free, const AdjustedPoints& held,
                          const NoiseSigmas& sigmas, const SolverOptions& solver_options) {
  const std::array<std::vector<image_t>, 2> halves = HalvesOf(free.model);
  std::vector<double> costs_free, costs_held;
  for (const size_t from : {0, 1}) {
    const std::vector<image_t>& others = halves[1 - from];
    const auto part = [&](const AdjustedPoints& points, const std::vector<image_t>& images,
                          bool hold_cameras) {
      return BundleSelection::Around(points.model, OfPoints(points.options), images,
                                     {.surroundings = false, .hold_cameras = hold_cameras});
    };
    const HeldOutPoints held_out(free.model, part(free, others, true));
    const auto append = [&](const AdjustedPoints& points, std::vector<double>* costs) {
      const BundleOptions options = OfPoints(points.options);
      BundleSelection half = part(points, halves[from], false);
      half.HoldUncertainIntrinsics(points.model, options);
      Reconstruction carried = points.model;
      AdjustPart(options, half, sigmas, StepsFromNear(solver_options, kIterationsOfHalf), &carried);
      // Points and poses of the half are moved, too: the others begin where they were.
      Reconstruction start = points.model;
      for (auto& [id, camera] : start.cameras) camera = carried.cameras.at(id);
      AdjustPart(options, part(points, others, true), sigmas,
                 StepsFromNear(solver_options, kIterationsOfHalf), &start);
      for (size_t fold = 0; fold < HeldOutPoints::kNumFolds; ++fold) {
        const auto found = Costs(options, start, part(points, others, true), held_out, fold, sigmas,
                                 solver_options);
        costs->insert(costs->end(), found.begin(), found.end());
      }
    };
    append(free, &costs_free);
    append(held, &costs_held);
  }
  return MeanOf(costs_free, costs_held);
}

}  // namespace holba
