// SPDX-License-Identifier: BSD-3-Clause
// group_line_3d: how far two points X of a line (at given positions along it: its end points at the
// start) are from the group, model units, R^6. X - Proj_G(X); of a type that projects lines only
// the moments (X x d' - m') / |d'| about the projected line (d', m'), whose norms are the
// distances. Blocks: line (the feature), group. Absent: undefined for either. A 3D form that the
// paper argues against, for comparison only: it needs a weight and changes with the scale of the
// scene.
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
    return type->project_point ? EvaluatePoints(datum, values, residual, jacobians)
                               : EvaluateLine(datum, values, residual, jacobians);
  }

 private:
  bool EvaluatePoints(const Datum& datum, const double* const* values, double* residual,
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

  bool EvaluateLine(const Datum& datum, const double* const* values, double* residual,
                    double* const* jacobians) const {
    const Eigen::Vector3d d(values[0][0], values[0][1], values[0][2]);
    const Eigen::Vector3d p(values[0][3], values[0][4], values[0][5]);
    Vector6d world, on_group;
    world << d, p.cross(d);
    RowMajor<6, 6> d_line;
    double d_group[6 * kMaxGroupParams];
    if (!type->project_line_with_jacobian(values[1], world, &on_group, d_line.data(), d_group))
      return false;
    const Eigen::Vector3d direction = on_group.head<3>(), moment = on_group.tail<3>();
    const double length = direction.norm();
    if (!(length > 0.0)) return false;
    const Eigen::Matrix<double, 3, 2> basis = TangentBasis(d);
    Eigen::Matrix<double, 6, 4> line_by_tangent;
    line_by_tangent << basis, Eigen::Matrix<double, 3, 2>::Zero(), CrossMatrix(p) * basis,
        -CrossMatrix(d) * basis;
    for (int e = 0; e < 2; ++e) {
      const Eigen::Vector3d X = p + datum.positions[e] * d;
      const Eigen::Vector3d r = (X.cross(direction) - moment) / length;
      Eigen::Map<Eigen::Vector3d>{residual + 3 * e} = r;
      Eigen::Matrix<double, 3, 6> by_on_group;
      by_on_group << CrossMatrix(X) / length - r * direction.transpose() / (length * length),
          -Eigen::Matrix3d::Identity() / length;
      if (jacobians[0]) {
        Eigen::Matrix<double, 3, 4> end_by_tangent;
        end_by_tangent << datum.positions[e] * basis, basis;
        Eigen::Map<RowMajor<3, 4>>{jacobians[0] + 12 * e} =
            by_on_group * d_line * line_by_tangent -
            CrossMatrix(direction) / length * end_by_tangent;
      }
      if (jacobians[1]) {
        internal::WriteJacobian((by_on_group * ByGroupTangent<6>(*type, values[1], d_group)).eval(),
                                jacobians[1] + 3 * type->manifold->tangent * e);
      }
    }
    return true;
  }
};

}  // namespace holba
