// SPDX-License-Identifier: BSD-3-Clause
// Covariances of the blocks of a problem at its state: the blocks of (J^T J)^-1, where J is the
// Jacobian of the weighted, robustified residuals with respect to the variable tangent coordinates
// (as Ceres' Covariance with apply_loss_function). If the weights are inverse variances of the
// residuals, the covariances are in the units of the tangents.
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
  // Factorises the reduced system, computes the blocks of its inverse, and from those the
  // covariances of the features. This takes as long as two to four iterations where the reduced
  // system is small or sparse. Empty: the system is singular (the gauge is not fixed, or no
  // residual constrains a kept block). The workspace of the problem's Solve saves the analysis.
  static std::optional<Covariance> Compute(const Problem& problem, int num_threads,
                                           SolverWorkspace* workspace = nullptr);

  // tangent x tangent. Rows and columns of held coordinates are 0, and so is the covariance of a
  // constant block or one that no residual holds. It is infinite for a feature that its residuals
  // do not determine.
  Eigen::MatrixXd Of(BlockId id) const;
  // Covariance of two kept blocks that share a residual or a feature. Empty: they share none, so
  // that their covariance, which is not 0, was not computed; or one of them is constant.
  std::optional<Eigen::MatrixXd> Between(BlockId a, BlockId b) const;

  Covariance(Covariance&&) noexcept;
  ~Covariance();

 private:
  struct Data;
  explicit Covariance(std::unique_ptr<Data> data);
  std::unique_ptr<Data> data_;
};

}  // namespace holba
