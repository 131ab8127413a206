// SPDX-License-Identifier: BSD-3-Clause
// The 3D forms that the paper argues against, for comparison only; in model units, so they need a weight and change with the
// scale of the scene.
//   group_point_3d: r = X - Proj_G(X), R^3. Blocks: point (the feature), group. Absent: Proj_G(X) undefined.
//   group_line_3d: the same for two points of a line, R^6: its points next to the given positions along it (its end points at the
//   start). Blocks: line (the feature), group. Absent: undefined for either.
//   wireframe_3d: r = (I - d d^T)(X - p), R^3, point to line. Blocks: point, line: two features, so one of them must be kept.
//   Always present.
#pragma once

#include "holba/residual/direction.h"
#include "holba/residual/group_tangent.h"
#include "holba/residual/view.h"

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
    if (!type->project_point_with_jacobian(values[1], X, &on_group, d_point.data(), d_group)) return false;
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
      if (!type->project_point_with_jacobian(values[1], X, &on_group, d_point.data(), d_group)) return false;
      Eigen::Map<Eigen::Vector3d>{residual + 3 * e} = X - on_group;
      if (jacobians[0]) {
        Eigen::Map<RowMajor<3, 4>> J(jacobians[0] + 12 * e);
        const Eigen::Matrix<double, 3, 2> by_anchor = (Eigen::Matrix3d::Identity() - d_point) * basis;
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

struct Wireframe3dResidual {
  static constexpr int kDim = 3;
  struct Datum {};

  bool Evaluate(const Datum&, const double* const* values, double* residual,
                double* const* jacobians) const {
    const Eigen::Map<const Eigen::Vector3d> X(values[0]);
    const Eigen::Vector3d d(values[1][0], values[1][1], values[1][2]);
    const Eigen::Vector3d p(values[1][3], values[1][4], values[1][5]);
    const Eigen::Vector3d v = X - p;
    const Eigen::Matrix3d across = Eigen::Matrix3d::Identity() - d * d.transpose();
    Eigen::Map<Eigen::Vector3d>{residual} = across * v;
    if (jacobians[0]) Eigen::Map<RowMajor<3, 3>>{jacobians[0]} = across;
    if (jacobians[1]) {
      const Eigen::Matrix<double, 3, 2> basis = TangentBasis(d);
      Eigen::Map<RowMajor<3, 4>> J(jacobians[1]);
      J.leftCols<2>() = -(d.dot(v) * Eigen::Matrix3d::Identity() + d * v.transpose()) * basis;
      J.rightCols<2>() = -across * basis;
    }
    return true;
  }
};

}  // namespace holba
