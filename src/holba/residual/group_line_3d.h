// SPDX-License-Identifier: BSD-3-Clause
// group_line_3d: X - Proj_G(X) for two points of a line, model units, R^6: those at given positions
// along it (its end points at the start). Blocks: line (the feature), group. Absent: undefined for
// either. A 3D form that the paper argues against, for comparison only: it needs a weight and
// changes with the scale of the scene.
#pragma once

#include "holba/residual/group_direction.h"

namespace holba {

struct GroupLine3dResidual {
  static constexpr int kDim = 6;
  struct Datum {
    double positions[2];  // along the direction, from the line block's anchor, model units
  };
  const GroupType* type;

  bool Evaluate(const Datum& datum, const double* const* values, double* residual,
                double* const* jacobians) const {
    const Eigen::Vector3d d(values[0][0], values[0][1], values[0][2]);
    const Eigen::Vector3d p(values[0][3], values[0][4], values[0][5]);
    const Eigen::Matrix<double, 3, 2> basis = TangentBasis(d);
    for (int e = 0; e < 2; ++e) {
      const Eigen::Vector3d X = p + datum.positions[e] * d;
      Eigen::Vector3d on_group;
      RowMajor<3, 3> d_point;
      double d_group[3 * kMaxGroupParams];
      if (!type->project_point_with_jacobian(values[1], X, &on_group, d_point.data(), d_group))
        return false;
      Eigen::Map<Eigen::Vector3d>{residual + 3 * e} = X - on_group;
      if (jacobians[0]) {
        Eigen::Map<RowMajor<3, 4>> J(jacobians[0] + 12 * e);
        const Eigen::Matrix<double, 3, 2> by_anchor =
            (Eigen::Matrix3d::Identity() - d_point) * basis;
        J.leftCols<2>() = datum.positions[e] * by_anchor;
        J.rightCols<2>() = by_anchor;
      }
      if (jacobians[1]) {
        internal::WriteJacobian((-ByGroupTangent<3>(*type, values[1], d_group)).eval(),
                                jacobians[1] + 3 * type->manifold->tangent * e);
      }
    }
    return true;
  }
};

}  // namespace holba
