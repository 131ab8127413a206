// SPDX-License-Identifier: BSD-3-Clause
// group_point_3d: r = X - Proj_G(X), model units, R^3. Blocks: point (the feature), group. Absent:
// Proj_G(X) undefined. A 3D form that the paper argues against, for comparison only: it needs a
// weight and changes with the scale of the scene.
#pragma once

#include "holba/residual/group_direction.h"

namespace holba {

struct GroupPoint3dResidual {
  static constexpr int kDim = 3;
  struct Datum {};
  const GroupType* type;

  bool Evaluate(const Datum&, const double* const* values, double* residual,
                double* const* jacobians) const {
    const Eigen::Map<const Eigen::Vector3d> X(values[0]);
    Eigen::Vector3d on_group;
    RowMajor<3, 3> d_point;
    double d_group[3 * kMaxGroupParams];
    if (!type->project_point_with_jacobian(values[1], X, &on_group, d_point.data(), d_group))
      return false;
    Eigen::Map<Eigen::Vector3d>{residual} = X - on_group;
    if (jacobians[0]) {
      Eigen::Map<RowMajor<3, 3>>{jacobians[0]} = Eigen::Matrix3d::Identity() - d_point;
    }
    if (jacobians[1]) {
      internal::WriteJacobian((-ByGroupTangent<3>(*type, values[1], d_group)).eval(), jacobians[1]);
    }
    return true;
  }
};

}  // namespace holba
