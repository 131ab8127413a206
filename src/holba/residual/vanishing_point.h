// SPDX-License-Identifier: BSD-3-Clause
// vp: r = d x v, R^3, |r| the sine of the angle between a line and its vanishing direction (paper,
// Eq. 8; as a vector, because the norm has no derivative at 0). Blocks: line (the one feature),
// group. Always present.
#pragma once

#include "holba/problem/vector_work.h"
#include "holba/residual/group_direction.h"

namespace holba {

struct VanishingPointResidual {
  static constexpr int kDim = 3;
  struct Datum {};
  const GroupType* type;

  bool Evaluate(const Datum&, const double* const* values, double* residual,
                double* const* jacobians) const {
    const Eigen::Vector3d d(values[0][0], values[0][1], values[0][2]);
    const GroupDirection v(*type, values[1]);
    Eigen::Map<Eigen::Vector3d>{residual} = d.cross(v.value);
    if (jacobians[0]) {
      Eigen::Map<RowMajor<3, 4>> J(jacobians[0]);
      J.leftCols<2>() = -CrossMatrix(v.value) * TangentBasis(d);
      J.rightCols<2>().setZero();
    }
    if (jacobians[1]) internal::WriteJacobian((CrossMatrix(d) * v.d_tangent).eval(), jacobians[1]);
    return true;
  }

  // In packs (vectorised.h); false: not this one, nothing was done.
  bool EvaluateVectorised(const VectorWork& work) const;
};

}  // namespace holba
