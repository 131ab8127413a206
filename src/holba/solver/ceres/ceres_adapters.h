// SPDX-License-Identifier: BSD-3-Clause
// holba's manifolds, losses and residuals as Ceres wants them: ranges of one, Jacobians of ambient
// coordinates.
#pragma once

#include <ceres/cost_function.h>
#include <ceres/loss_function.h>
#include <ceres/manifold.h>

#include <cstdint>
#include <vector>

#include "holba/problem/problem.h"

namespace holba {

// A block's manifold without its held tangent coordinates.
//
// Ceres multiplies the Jacobians of residuals by PlusJacobian and uses both for nothing else.
// Residuals know their derivatives by the tangent, so these stand in the first columns of what
// Ceres takes for the Jacobian by the ambient coordinates, and PlusJacobian merely picks the free
// ones: the round trip over the true ambient Jacobian would cost more than many a residual.
class CeresManifold final : public ceres::Manifold {
 public:
  CeresManifold(const ManifoldOps& ops, uint32_t held);
  int AmbientSize() const override { return ops_.ambient; }
  int TangentSize() const override { return static_cast<int>(free_.size()); }
  bool Plus(const double* x, const double* delta, double* x_plus_delta) const override;
  bool PlusJacobian(const double* x, double* jacobian) const override;
  bool Minus(const double* y, const double* x, double* y_minus_x) const override;
  bool MinusJacobian(const double* x, double* jacobian) const override;

 private:
  const ManifoldOps& ops_;
  std::vector<int> free_;  // tangent coordinates that move
};

class CeresLoss final : public ceres::LossFunction {
 public:
  CeresLoss(const Loss& loss, double weight) : loss_(loss), weight_(weight) {}
  void Evaluate(double s, double rho[3]) const override {
    loss_.Evaluate(s, rho);
    for (int i = 0; i < 3; ++i) rho[i] *= weight_;
  }

 private:
  Loss loss_;
  double weight_;
};

// Value that a residual had when it was last present at an accepted state; it stands in while the
// residual is absent, with a zero Jacobian, so that hiding a residual gains nothing.
struct ResidualMemory {
  std::vector<double> values;    // dim per residual
  std::vector<uint8_t> known;    // was present once
  std::vector<uint8_t> present;  // at the last accepted state

  void Resize(size_t num_residuals, int dim) {
    values.resize(num_residuals * dim);
    known.resize(num_residuals);
    present.resize(num_residuals);
  }
};

class CeresResidual final : public ceres::CostFunction {
 public:
  CeresResidual(const Problem& problem, const ResidualBatch& batch, size_t index,
                ResidualMemory* memory);
  bool Evaluate(double const* const* parameters, double* residuals,
                double** jacobians) const override;

 private:
  const ResidualBatch& batch_;
  size_t index_;
  ResidualMemory*
      memory_;  // this residual's entries are written by whoever evaluates it: one thread at a time
};

}  // namespace holba
