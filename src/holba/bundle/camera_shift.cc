// SPDX-License-Identifier: BSD-3-Clause
#include "holba/bundle/camera_shift.h"

#include <Eigen/Cholesky>
#include <cmath>

#include "holba/base/check.h"
#include "holba/bundle/losses.h"
#include "holba/geometry/manifold.h"
#include "holba/solver/covariance.h"

namespace holba {
namespace {

// Variance of one observed coordinate, px^2. With a robust loss it is measured on the inliers; with
// the trivial loss wrong observations have moved the cameras, too, so that all observations count.
double NoiseVariance(const Problem& problem) {
  double sum = 0.0, count = 0.0;
  bool robust = true;
  for (const auto& batch : problem.batches()) {
    if (batch->term() == "point") robust &= batch->loss.type != LossType::kTrivial;
  }
  if (robust) {
    const double sigma = RobustSigma(problem, "point");
    return sigma * sigma;
  }
  for (double r : ResidualNorms(problem, "point", true)) {
    sum += r * r;
    count += 1.0;
  }
  return count > 0.0 ? sum / count : 0.0;
}

// Of frames, then of sensors in their rigs.
std::vector<BlockId> PoseBlocks(const BundleProblem& bundle) {
  std::vector<BlockId> blocks;
  for (const auto& [id, block] : bundle.poses) blocks.push_back(block);
  for (const auto& [id, block] : bundle.sensors) blocks.push_back(block);
  return blocks;
}

}  // namespace

std::optional<CameraReference> CameraReference::Of(const BundleProblem& points, int num_threads,
                                                   SolverWorkspace* workspace) {
  const double variance = NoiseVariance(points.problem);
  if (!(variance > 0.0)) return std::nullopt;
  const std::optional<Covariance> covariance =
      Covariance::Compute(points.problem, num_threads, workspace);
  if (!covariance) return std::nullopt;
  CameraReference reference;
  const std::vector<BlockId> blocks = PoseBlocks(points);
  for (size_t index = 0; index < blocks.size(); ++index) {
    const BlockId block = blocks[index];
    const uint32_t mask = points.problem.block(block).FreeMask();
    Pose pose{index, {}, {}, {}};
    for (int k = 0; k < PoseManifold::kTangent; ++k) {
      if (mask >> k & 1) pose.free.push_back(k);
    }
    if (pose.free.empty()) continue;
    const Eigen::MatrixXd C = variance * covariance->Of(block)(pose.free, pose.free);
    if (!C.allFinite()) continue;
    const Eigen::LDLT<Eigen::MatrixXd> ldlt(C);
    if (ldlt.info() != Eigen::Success || !(ldlt.vectorD().minCoeff() > 0.0)) continue;
    pose.information = ldlt.solve(Eigen::MatrixXd::Identity(C.rows(), C.cols()));
    const double* values = points.problem.values(block);
    pose.values.assign(values, values + PoseManifold::kAmbient);
    reference.poses_.push_back(std::move(pose));
  }
  if (reference.poses_.empty()) return std::nullopt;
  return reference;
}

double CameraReference::ShiftSigmas(const BundleProblem& other) const {
  double sum = 0.0, count = 0.0;
  const std::vector<BlockId> blocks = PoseBlocks(other);
  for (const Pose& pose : poses_) {
    HOLBA_CHECK(pose.index < blocks.size());
    Eigen::Matrix<double, PoseManifold::kTangent, 1> moved;
    PoseManifold::Minus(other.problem.values(blocks[pose.index]), pose.values.data(), moved.data());
    const Eigen::VectorXd d = moved(pose.free);
    sum += d.dot(pose.information * d);
    count += static_cast<double>(pose.free.size());
  }
  return std::sqrt(sum / count);
}

}  // namespace holba
