// SPDX-License-Identifier: BSD-3-Clause
// relation: r = a . b (orthogonal, R) or a x b (parallel, R^3) of unit directions or normals.
// Blocks: groups. Always present.
#pragma once

#include "holba/residual/group_direction.h"

namespace holba {

struct OrthogonalResidual {
  static constexpr int kDim = 1;
  struct Datum {};
  const GroupType* types[2];

  bool Evaluate(const Datum&, const double* const* values, double* residual,
                double* const* jacobians) const {
    const GroupDirection a(*types[0], values[0]), b(*types[1], values[1]);
    residual[0] = a.value.dot(b.value);
    if (jacobians[0])
      internal::WriteJacobian((b.value.transpose() * a.d_tangent).eval(), jacobians[0]);
    if (jacobians[1])
      internal::WriteJacobian((a.value.transpose() * b.d_tangent).eval(), jacobians[1]);
    return true;
  }
};

struct ParallelResidual {
  static constexpr int kDim = 3;
  struct Datum {};
  const GroupType* types[2];

  bool Evaluate(const Datum&, const double* const* values, double* residual,
                double* const* jacobians) const {
    const GroupDirection a(*types[0], values[0]), b(*types[1], values[1]);
    Eigen::Map<Eigen::Vector3d>{residual} = a.value.cross(b.value);
    if (jacobians[0])
      internal::WriteJacobian((-CrossMatrix(b.value) * a.d_tangent).eval(), jacobians[0]);
    if (jacobians[1])
      internal::WriteJacobian((CrossMatrix(a.value) * b.d_tangent).eval(), jacobians[1]);
    return true;
  }
};

}  // namespace holba
