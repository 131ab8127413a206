// SPDX-License-Identifier: BSD-3-Clause
// Uncertainty of every block of a problem at its state: the blocks of (J^T J)^-1, J the Jacobian of
// the robustified, weighted residuals by the free tangent coordinates (as Ceres' Covariance with
// its loss functions applied). Residuals in units of their standard deviation (weights) give
// covariances in the units of the tangents.
#pragma once

#include <Eigen/Core>
#include <memory>
#include <optional>
#include <vector>

#include "holba/problem/problem.h"
#include "holba/solver/solver.h"

namespace holba {

class Covariance {
 public:
  // From the factor of the reduced system: its inverse on its own blocks, and from those the
  // features' covariances, in the time of two to four iterations where the reduced system is small
  // or sparse. Empty: it is singular (a gauge that is not fixed, a kept block that nothing
  // observes). `workspace`: that of the problem's Solve saves the analysis.
  static std::optional<Covariance> Compute(const Problem& problem, int num_threads,
                                           SolverWorkspace* workspace = nullptr);

  // tangent x tangent, infinite for a feature that its residuals do not fix; rows and columns of
  // held coordinates are 0, and so is all of a constant block, and of a block that no residual
  // holds.
  Eigen::MatrixXd Of(BlockId id) const;
  // Of two kept blocks that share a residual or a feature. Empty: they share none (their covariance
  // is not 0, but is not known here), or one of them does not move.
  std::optional<Eigen::MatrixXd> Between(BlockId a, BlockId b) const;

  Covariance(Covariance&&) noexcept;
  ~Covariance();

 private:
  struct Data;
  explicit Covariance(std::unique_ptr<Data> data);
  std::unique_ptr<Data> data_;
};

}  // namespace holba
