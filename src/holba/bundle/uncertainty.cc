// SPDX-License-Identifier: BSD-3-Clause
#include "holba/bundle/uncertainty.h"

#include <cmath>

#include "holba/bundle/bundle_problem.h"
#include "holba/geometry/manifold.h"
#include "holba/solver/covariance.h"

namespace holba {
namespace {

// Tangent of a pose in the world by that of the local pose. With c the local origin in the world
// and s the local unit, t = s t_local - R c: a rotation R' = exp(w) R moves t, too.
Matrix6d WorldPoseByLocal(const Sim3d& world_from_local, const Rigid3d& cam_from_local) {
  Matrix6d J = Matrix6d::Identity();
  const Eigen::Vector3d c_in_cam = cam_from_local.rotation * world_from_local.translation;
  J.bottomLeftCorner<3, 3>() = CrossMatrix(c_in_cam);
  J.bottomRightCorner<3, 3>() *= world_from_local.scale;
  return J;
}

// Adds what the problem of `options` knows and `result` does not have yet; false: singular. The
// model is in its local frame, the results are in the world.
bool AddCovariances(const Reconstruction& model, const Sim3d& world_from_local,
                    const BundleOptions& options, const BundleSelection& selection,
                    const BundleSummary& summary, const StructureWeights& weights,
                    std::span<const GroupMeasurement> measurements, int num_threads,
                    ModelUncertainty* result) {
  const BundleProblem bundle =
      BuildProblem(model, options, selection, measurements, &summary.filter);
  const Problem& problem = bundle.problem;
  for (const auto& batch : problem.batches()) {
    const auto scale = summary.auto_scales.find(batch->term());
    if (scale != summary.auto_scales.end()) batch->loss = {LossType::kCauchy, scale->second};
    batch->weight *= weights.Of(batch->term());
    if (batch->angular) batch->weight *= summary.angular_weight_factor;
    if (batch->term() == "structure_point") batch->weight *= summary.structure_point_weight_factor;
  }
  const std::optional<Covariance> covariance = Covariance::Compute(problem, num_threads);
  if (!covariance) return false;

  double sigma_px = RobustSigma(problem, "point");
  if (!(sigma_px > 0.0)) sigma_px = RobustSigma(problem, "line");
  if (result->sigma_px == 0.0) result->sigma_px = sigma_px;
  const double variance = result->sigma_px * result->sigma_px;
  const double area = world_from_local.scale * world_from_local.scale;
  for (const auto& [id, block] : bundle.poses) {
    const Eigen::MatrixXd C = variance * covariance->Of(block);
    if (!C.allFinite()) continue;
    const Matrix6d J = WorldPoseByLocal(world_from_local, model.frames.at(id).rig_from_world);
    result->poses.emplace(id, J * C * J.transpose());
  }
  for (const auto& [id, block] : bundle.sensors) {
    const Eigen::MatrixXd C = variance * covariance->Of(block);
    if (!C.allFinite()) continue;
    // The place of the origin has no say here.
    Matrix6d J = Matrix6d::Identity();
    J.bottomRightCorner<3, 3>() *= world_from_local.scale;
    result->sensors.emplace(std::pair(id.rig_id, id.camera_id), J * C * J.transpose());
  }
  for (const auto& [id, block] : bundle.points) {
    const Eigen::MatrixXd C = area * variance * covariance->Of(block);
    if (C.allFinite()) result->points.emplace(id, C);
  }
  for (const auto& [id, block] : bundle.lines) {
    const Eigen::MatrixXd C = area * variance * covariance->Of(block);
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
    const GroupType& type = *model.groups3D.at(id).type;
    RowMajor<Eigen::Dynamic, Eigen::Dynamic> J(type.num_file_params, type.manifold->tangent);
    type.file_jacobian(world_from_local, problem.values(block), J.data());
    result->groups.emplace(id, J * C * J.transpose());
  }
  return true;
}

}  // namespace

std::optional<ModelUncertainty> EstimateUncertainty(
    const Reconstruction& given_model, const BundleOptions& given, const BundleSummary& summary,
    int num_threads, std::span<const GroupMeasurement> measurements) {
  BundleOptions options = given;
  options.SetDefaultLosses(false);
  Reconstruction model = given_model;
  const LocalFrame local(&model, FrameUnit(options));
  const Sim3d world_from_local = local.local_from_world().Inverse();
  ModelUncertainty result;
  BundleSelection selection = BundleSelection::Everything(model, options);
  selection.HoldUncertainIntrinsics(model, options);
  const WeightChoice& choice = summary.weight_choice;
  if (!choice.IsAsGiven()) {
    // First what moved the cameras, with the weights that it had.
    BundleOptions of_cameras = options;
    BundleSelection seen = SelectionOfCameras(model, choice, selection);
    if (choice.weights.points_alone) of_cameras.config = BundleConfig::kPoint;
    if (!AddCovariances(
            model, world_from_local, of_cameras, seen, summary, choice.weights.structure,
            choice.weights.points_alone ? std::span<const GroupMeasurement>() : measurements,
            num_threads, &result))
      return std::nullopt;
    selection.HoldCameras();
  }
  if (!AddCovariances(model, world_from_local, options, selection, summary, {}, measurements,
                      num_threads, &result))
    return std::nullopt;
  return result;
}

}  // namespace holba
