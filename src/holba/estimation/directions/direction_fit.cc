// SPDX-License-Identifier: BSD-3-Clause
#include "holba/estimation/directions/direction_fit.h"

#include <Eigen/Eigenvalues>

namespace holba {
namespace {

constexpr int kMaxIterations = 20;
// Far below what segments can tell (about 0.1 degree).
constexpr double kConvergedRad = 1e-7;
// Of the second eigenvalue to the third: below it all planes meet in no single direction.
constexpr double kMinSpread = 1e-12;

}  // namespace

std::optional<Eigen::Vector3d> RefineDirection(std::span<const DirectionEvidence> evidence,
                                               double max_error_px, const Eigen::Vector3d& start) {
  Eigen::Vector3d d = start.normalized();
  const double max_squared = max_error_px * max_error_px;
  for (int iteration = 0; iteration < kMaxIterations; ++iteration) {
    Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
    int num_agreeing = 0;
    for (const DirectionEvidence& segment : evidence) {
      const double relative = segment.SquaredError(d) / max_squared;
      if (!(relative < 1.0)) continue;
      const double weight = (1.0 - relative) * (1.0 - relative) / segment.SquaredDistance(d);
      scatter += (weight * segment.normal()) * segment.normal().transpose();
      ++num_agreeing;
    }
    if (num_agreeing < 2) return std::nullopt;
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(scatter);
    if (!(eigen.eigenvalues()[1] > kMinSpread * eigen.eigenvalues()[2])) return std::nullopt;
    Eigen::Vector3d next = eigen.eigenvectors().col(0);
    if (next.dot(d) < 0.0) next = -next;
    const double change = (next - d).norm();
    d = next;
    if (change < kConvergedRad) break;
  }
  return d;
}

}  // namespace holba
