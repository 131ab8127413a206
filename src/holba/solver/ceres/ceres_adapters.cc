// SPDX-License-Identifier: BSD-3-Clause
#include "holba/solver/ceres/ceres_adapters.h"

#include <algorithm>

namespace holba {
namespace {

// J (dim x tangent) * MinusJacobian (tangent x ambient), row-major, for the sizes of the manifolds
// that are met most.
template <int Tangent, int Ambient>
void MultiplyFixed(const double* J, const double* minus, int dim, double* out) {
  const Eigen::Map<const RowMajor<Tangent, Ambient>> m(minus);
  for (int row = 0; row < dim; ++row) {
    Eigen::Map<Eigen::Matrix<double, 1, Ambient>>{out + row* Ambient} =
        Eigen::Map<const Eigen::Matrix<double, 1, Tangent>>{J + row * Tangent} * m;
  }
}

void MultiplyInto(const double* J, const double* minus, int dim, const ManifoldOps& ops,
                  double* out) {
  if (ops.tangent == 6 && ops.ambient == 7) return MultiplyFixed<6, 7>(J, minus, dim, out);
  if (ops.tangent == 4 && ops.ambient == 6) return MultiplyFixed<4, 6>(J, minus, dim, out);
  if (ops.tangent == 3 && ops.ambient == 4) return MultiplyFixed<3, 4>(J, minus, dim, out);
  if (ops.tangent == 2 && ops.ambient == 3) return MultiplyFixed<2, 3>(J, minus, dim, out);
  for (int i = 0; i < dim; ++i) {
    for (int j = 0; j < ops.ambient; ++j) {
      double sum = 0.0;
      for (int k = 0; k < ops.tangent; ++k)
        sum += J[i * ops.tangent + k] * minus[k * ops.ambient + j];
      out[i * ops.ambient + j] = sum;
    }
  }
}

}  // namespace

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

bool CeresManifold::PlusJacobian(const double* x, double* jacobian) const {
  double full[kMaxTangent * kMaxTangent];
  ops_.plus_jacobian(x, full);
  const int n = TangentSize();
  for (int row = 0; row < ops_.ambient; ++row) {
    for (int i = 0; i < n; ++i) jacobian[row * n + i] = full[row * ops_.tangent + free_[i]];
  }
  return true;
}

bool CeresManifold::Minus(const double* y, const double* x, double* y_minus_x) const {
  double full[kMaxTangent];
  ops_.minus(y, x, full);
  for (size_t i = 0; i < free_.size(); ++i) y_minus_x[i] = full[free_[i]];
  return true;
}

bool CeresManifold::MinusJacobian(const double* x, double* jacobian) const {
  double full[kMaxTangent * kMaxTangent];
  ops_.minus_jacobian(x, full);
  for (size_t i = 0; i < free_.size(); ++i) {
    std::copy_n(full + free_[i] * ops_.ambient, ops_.ambient, jacobian + i * ops_.ambient);
  }
  return true;
}

CeresResidual::CeresResidual(const Problem& problem, const ResidualBatch& batch, size_t index,
                             ResidualMemory* memory)
    : problem_(problem), batch_(batch), index_(index), memory_(memory) {
  set_num_residuals(batch.dim());
  for (int s = 0; s < batch.num_slots(); ++s) {
    mutable_parameter_block_sizes()->push_back(
        problem.block(batch.block(index, s)).manifold->ambient);
  }
}

bool CeresResidual::Evaluate(double const* const* parameters, double* residuals,
                             double** jacobians) const {
  double tangent_jacobians[kMaxSlots][kMaxResidualDim * kMaxTangent];
  ResidualPanel panel;
  bool present = false;
  panel.residuals = residuals;
  panel.present = &present;
  const int slots = batch_.num_slots();
  if (jacobians) {
    for (int s = 0; s < slots; ++s) {
      if (!jacobians[s]) continue;
      const ManifoldOps& ops = *problem_.block(batch_.block(index_, s)).manifold;
      panel.jacobians[s] = ops.ambient == ops.tangent ? jacobians[s] : tangent_jacobians[s];
    }
  }
  batch_.Evaluate(index_, index_ + 1, ParameterReader(parameters), panel);

  const int dim = batch_.dim();
  double* remembered = &memory_->values[index_ * dim];
  if (!present) {
    if (memory_->known[index_]) std::copy_n(remembered, dim, residuals);
  } else if (jacobians) {
    std::copy_n(residuals, dim, remembered);
    memory_->known[index_] = 1;
  }
  if (!jacobians) return true;
  for (int s = 0; s < slots; ++s) {
    if (!jacobians[s] || panel.jacobians[s] == jacobians[s]) continue;
    const ManifoldOps& ops = *problem_.block(batch_.block(index_, s)).manifold;
    double minus[kMaxTangent * kMaxTangent];
    ops.minus_jacobian(parameters[s], minus);
    MultiplyInto(tangent_jacobians[s], minus, dim, ops, jacobians[s]);
  }
  return true;
}

}  // namespace holba
