// SPDX-License-Identifier: BSD-3-Clause
#include "apps/map/position_alignment.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "holba/evaluation/alignment.h"
#include "holba/geometry/earth.h"
#include "holba/robust/median.h"

namespace holba {
namespace {

// Of angles, and of the scale: 3 degrees, 5 %.
constexpr double kMaxSigma = 0.05;

}  // namespace

std::optional<PositionAlignment> AlignToPositions(const std::map<image_t, PosePrior>& priors,
                                                  Reconstruction* model) {
  PositionAlignment result;
  // Positions as centres of cameras that look anywhere: a model to align to.
  Reconstruction truth;
  std::optional<Eigen::Matrix3d> axes;
  for (const auto& [id, prior] : priors) {
    const Image* image = model->images.Find(id);
    if (image == nullptr || !prior.position) continue;
    Eigen::Vector3d position = *prior.position;
    if (prior.system == PosePrior::System::kWgs84) {
      if (!result.origin) {
        result.origin = position;
        axes = EastNorthUp(position);
      }
      position = *axes * (EarthCentred(position) - EarthCentred(*result.origin));
    }
    Image placed{.name = image->name};
    placed.cam_from_world.translation = -position;
    truth.images.Add(id, std::move(placed));
  }
  result.num_positions = truth.images.size();
  if (result.num_positions < 3) return std::nullopt;
  std::vector<Eigen::Vector3d> from, to;
  for (const auto& [id, image] : truth.images) {
    from.push_back(model->CameraCentre(id));
    to.push_back(truth.CameraCentre(id));
  }
  const auto alignment =
      EstimateSimilarity(from, to)
          ? AlignReconstructions(*model, truth, PairImages(*model, truth), AlignmentBasis::kCentres)
          : std::nullopt;
  if (!alignment) {
    result.why_not = "the positions are on one line, about which the model may turn";
    return result;
  }
  result.num_left_out = alignment->num_left_out;
  std::vector<double> errors;
  for (size_t i = 0; i < to.size(); ++i)
    errors.push_back((alignment->truth_from_model * from[i] - to[i]).norm());
  result.median_error = Median(errors);
  // Of the positions that were not left out.
  std::vector<Eigen::Vector3d> good;
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (size_t i = 0; i < to.size(); ++i) {
    if (errors[i] > 10.0 * result.median_error) continue;
    good.push_back(to[i]);
    mean += to[i];
  }
  mean /= static_cast<double>(good.size());
  Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
  for (const Eigen::Vector3d& position : good)
    scatter += (position - mean) * (position - mean).transpose();
  // The rotation about the longest axis rests on what lies across it.
  const Eigen::Vector3d spread =
      Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(scatter, Eigen::EigenvaluesOnly).eigenvalues();
  if (!(result.median_error <= kMaxSigma * std::sqrt(std::max(0.0, spread[1])))) {
    result.why_not = "the positions are too inexact for the extent of the model";
    return result;
  }
  result.scale = alignment->truth_from_model.scale;
  model->Transform(alignment->truth_from_model);
  return result;
}

}  // namespace holba
