// SPDX-License-Identifier: BSD-3-Clause
#include "holba/bundle/uncertainty.h"

#include <cmath>

#include "holba/bundle/bundle_problem.h"
#include "holba/geometry/manifold.h"
#include "holba/solver/covariance.h"

namespace holba {
namespace {

// d(plain parameters of the file) / d(tangent of the parameters in memory), by central differences:
// files hold smooth functions of what is in memory.
Eigen::MatrixXd FileParamsByTangent(const GroupType& type, const double* g) {
  constexpr double kStep = 1e-6;
  const int tangent = type.manifold->tangent;
  Eigen::MatrixXd J(type.num_file_params, tangent);
  for (int c = 0; c < tangent; ++c) {
    Eigen::VectorXd delta = Eigen::VectorXd::Zero(tangent), plain[2];
    for (int side = 0; side < 2; ++side) {
      double moved[kMaxGroupParams];
      delta[c] = side == 0 ? -kStep : kStep;
      type.manifold->plus(g, delta.data(), moved);
      plain[side].resize(type.num_file_params);
      type.to_file(moved, plain[side].data());
    }
    J.col(c) = (plain[1] - plain[0]) / (2.0 * kStep);
  }
  return J;
}

// Adds what the problem of `options` knows and `result` does not have yet; false: singular.
bool AddCovariances(const Reconstruction& model, const BundleOptions& options,
                    const BundleSelection& selection, const BundleSummary& summary,
                    std::span<const GroupMeasurement> measurements, int num_threads,
                    ModelUncertainty* result) {
  const BundleProblem bundle =
      BuildProblem(model, options, selection, measurements, &summary.filter);
  const Problem& problem = bundle.problem;
  for (const auto& batch : problem.batches()) {
    const auto scale = summary.auto_scales.find(batch->term());
    if (scale != summary.auto_scales.end()) batch->loss = {LossType::kCauchy, scale->second};
    if (batch->angular) batch->weight *= summary.angular_weight_factor;
    if (batch->term() == "structure_point") batch->weight *= summary.structure_point_weight_factor;
  }
  const std::optional<Covariance> covariance = Covariance::Compute(problem, num_threads);
  if (!covariance) return false;

  double sigma_px = RobustSigma(problem, "point");
  if (!(sigma_px > 0.0)) sigma_px = RobustSigma(problem, "line");
  if (result->sigma_px == 0.0) result->sigma_px = sigma_px;
  const double variance = result->sigma_px * result->sigma_px;
  for (const auto& [id, block] : bundle.poses) {
    const Eigen::MatrixXd C = variance * covariance->Of(block);
    if (C.allFinite()) result->poses.emplace(id, C);
  }
  for (const auto& [id, block] : bundle.points) {
    const Eigen::MatrixXd C = variance * covariance->Of(block);
    if (C.allFinite()) result->points.emplace(id, C);
  }
  for (const auto& [id, block] : bundle.lines) {
    const Eigen::MatrixXd C = variance * covariance->Of(block);
    if (!C.allFinite()) continue;
    const double* v = problem.values(block);
    const Eigen::Vector3d d(v[0], v[1], v[2]), anchor(v[3], v[4], v[5]);
    const Eigen::Matrix<double, 3, 2> basis = TangentBasis(d);
    const auto at = [&](const Eigen::Vector3d& X) -> Eigen::Matrix3d {
      Eigen::Matrix<double, 3, 4> J;
      J << d.dot(X - anchor) * basis, basis;
      return J * C * J.transpose();
    };
    const Line3D& line = model.lines3D.at(id);
    result->lines.emplace(id, LineCovariance{at(line.start), at(line.end)});
  }
  for (const auto& [id, block] : bundle.groups) {
    const Eigen::MatrixXd C = variance * covariance->Of(block);
    if (!C.allFinite()) continue;
    const Eigen::MatrixXd J =
        FileParamsByTangent(*model.groups3D.at(id).type, problem.values(block));
    result->groups.emplace(id, J * C * J.transpose());
  }
  return true;
}

}  // namespace

std::optional<ModelUncertainty> EstimateUncertainty(
    const Reconstruction& model, const BundleOptions& given, const BundleSummary& summary,
    int num_threads, std::span<const GroupMeasurement> measurements) {
  BundleOptions options = given;
  options.SetDefaultLosses(false);
  ModelUncertainty result;
  BundleSelection selection = BundleSelection::Everything(model, options);
  selection.HoldUncertainIntrinsics(model, options);
  if (summary.cameras_held) {
    // What contradicts the points does not make the cameras surer.
    BundleOptions points_only = options;
    points_only.config = BundleConfig::kPoint;
    if (!AddCovariances(model, points_only, WithoutPointsOfStructure(model, selection), summary,
                        {}, num_threads, &result))
      return std::nullopt;
    selection.HoldCameras();
  }
  if (!AddCovariances(model, options, selection, summary, measurements, num_threads, &result))
    return std::nullopt;
  return result;
}

}  // namespace holba
