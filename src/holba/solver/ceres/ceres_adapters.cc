// SPDX-License-Identifier: BSD-3-Clause
#include "holba/solver/ceres/ceres_adapters.h"

#include <algorithm>

namespace holba {

CeresManifold::CeresManifold(const ManifoldOps& ops, uint32_t held) : ops_(ops) {
  for (int i = 0; i < ops.tangent; ++i) {
    if (!(held >> i & 1)) free_.push_back(i);
  }
}

bool CeresManifold::Plus(const double* x, const double* delta, double* x_plus_delta) const {
  double full[kMaxTangent] = {};
  for (size_t i = 0; i < free_.size(); ++i) full[free_[i]] = delta[i];
  ops_.plus(x, full, x_plus_delta);
  return true;
}

bool CeresManifold::PlusJacobian(const double*, double* jacobian) const {
  const size_t n = free_.size();
  std::fill_n(jacobian, ops_.ambient * n, 0.0);
  for (size_t i = 0; i < n; ++i) jacobian[free_[i] * n + i] = 1.0;
  return true;
}

bool CeresManifold::Minus(const double* y, const double* x, double* y_minus_x) const {
  double full[kMaxTangent];
  ops_.minus(y, x, full);
  for (size_t i = 0; i < free_.size(); ++i) y_minus_x[i] = full[free_[i]];
  return true;
}

bool CeresManifold::MinusJacobian(const double*, double* jacobian) const {
  const size_t n = free_.size();
  std::fill_n(jacobian, n * ops_.ambient, 0.0);
  for (size_t i = 0; i < n; ++i) jacobian[i * ops_.ambient + free_[i]] = 1.0;
  return true;
}

CeresResidual::CeresResidual(const Problem& problem, const ResidualBatch& batch, size_t index,
                             ResidualMemory* memory)
    : batch_(batch), index_(index), memory_(memory) {
  set_num_residuals(batch.dim());
  for (int s = 0; s < batch.num_slots(); ++s) {
    mutable_parameter_block_sizes()->push_back(
        problem.block(batch.block(index, s)).manifold->ambient);
  }
}

bool CeresResidual::Evaluate(double const* const* parameters, double* residuals,
                             double** jacobians) const {
  double tangent_jacobians[kMaxSlots][kMaxResidualDim * kMaxTangent];
  const std::vector<int32_t>& ambients = parameter_block_sizes();
  ResidualPanel panel;
  bool present = false;
  panel.residuals = residuals;
  panel.present = &present;
  const int slots = batch_.num_slots();
  if (jacobians) {
    for (int s = 0; s < slots; ++s) {
      if (!jacobians[s]) continue;
      panel.jacobians[s] = ambients[s] == batch_.tangent(s) ? jacobians[s] : tangent_jacobians[s];
    }
  }
  batch_.Evaluate(index_, index_ + 1, ParameterReader(parameters), panel);

  const int dim = batch_.dim();
  double* remembered = &memory_->values[index_ * dim];
  if (jacobians) memory_->present[index_] = present;
  if (!present) {
    if (memory_->known[index_]) std::copy_n(remembered, dim, residuals);
  } else if (jacobians) {
    std::copy_n(residuals, dim, remembered);
    memory_->known[index_] = 1;
  }
  if (!jacobians) return true;
  for (int s = 0; s < slots; ++s) {
    if (!jacobians[s] || panel.jacobians[s] == jacobians[s]) continue;
    const int tangent = batch_.tangent(s), ambient = ambients[s];
    for (int k = 0; k < dim; ++k) {
      double* row = jacobians[s] + k * ambient;
      std::copy_n(tangent_jacobians[s] + k * tangent, tangent, row);
      std::fill(row + tangent, row + ambient, 0.0);
    }
  }
  return true;
}

}  // namespace holba
