// SPDX-License-Identifier: BSD-3-Clause
// Residuals of directions, free of scale: sines and cosines of angles, without unit.
//   vp: r = d x v, R^3, |r| the sine of the angle between line and vanishing direction (paper, Eq. 8; as a vector, because
//   the norm has no derivative at 0). Blocks: line (the one feature), group. Always present.
//   relation: r = a . b (orthogonal, R) or a x b (parallel, R^3) of unit directions or normals. Blocks: groups. Always present.
//   group_measurement: r = (R a) x u / sigma, R^3, u the direction measured in the camera frame (a vanishing point seen in an
//   image, a plane normal from a monocular network), sigma in radians. Blocks: group, pose. Always present.
#pragma once

#include "holba/residual/group_tangent.h"
#include "holba/residual/view.h"

namespace holba {

// Unit direction of a group and its derivative by the group's tangent.
struct GroupDirection {
  Eigen::Vector3d value;
  Eigen::Matrix<double, 3, Eigen::Dynamic, 0, 3, kMaxGroupParams> d_tangent;

  GroupDirection(const GroupType& type, const double* g) {
    double d_group[3 * kMaxGroupParams];
    type.direction(g, &value, d_group);
    d_tangent = ByGroupTangent<3>(type, g, d_group);
  }
};

namespace internal {
// Writes rows x tangent row-major.
template <typename Derived>
void WriteJacobian(const Eigen::MatrixBase<Derived>& from, double* to) {
  for (int r = 0; r < from.rows(); ++r) {
    for (int c = 0; c < from.cols(); ++c) *to++ = from(r, c);
  }
}
}  // namespace internal

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
};

struct OrthogonalResidual {
  static constexpr int kDim = 1;
  struct Datum {};
  const GroupType* types[2];

  bool Evaluate(const Datum&, const double* const* values, double* residual,
                double* const* jacobians) const {
    const GroupDirection a(*types[0], values[0]), b(*types[1], values[1]);
    residual[0] = a.value.dot(b.value);
    if (jacobians[0]) internal::WriteJacobian((b.value.transpose() * a.d_tangent).eval(), jacobians[0]);
    if (jacobians[1]) internal::WriteJacobian((a.value.transpose() * b.d_tangent).eval(), jacobians[1]);
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
    if (jacobians[0]) internal::WriteJacobian((-CrossMatrix(b.value) * a.d_tangent).eval(), jacobians[0]);
    if (jacobians[1]) internal::WriteJacobian((CrossMatrix(a.value) * b.d_tangent).eval(), jacobians[1]);
    return true;
  }
};

struct GroupMeasurementResidual {
  static constexpr int kDim = 3;
  struct Datum {
    Eigen::Vector3d measured_in_cam;  // unit; the sign does not matter
    double sigma_rad;
    const SensorPose* sensor;
  };
  const GroupType* type;

  bool Evaluate(const Datum& datum, const double* const* values, double* residual,
                double* const* jacobians) const {
    const GroupDirection a(*type, values[0]);
    Eigen::Matrix3d R = PoseRotation(values[1]);
    const Eigen::Vector3d in_rig = R * a.value;
    Eigen::Matrix3d d_rotation = -CrossMatrix(in_rig);
    Eigen::Vector3d in_cam = in_rig;
    if (datum.sensor) {
      in_cam = datum.sensor->rotation * in_rig;
      d_rotation = datum.sensor->rotation * d_rotation.eval();
      R = datum.sensor->rotation * R.eval();
    }
    const double inv_sigma = 1.0 / datum.sigma_rad;
    const Eigen::Matrix3d across = -inv_sigma * CrossMatrix(datum.measured_in_cam);
    Eigen::Map<Eigen::Vector3d>{residual} = across * in_cam;
    if (jacobians[0]) internal::WriteJacobian((across * R * a.d_tangent).eval(), jacobians[0]);
    if (jacobians[1]) {
      Eigen::Map<RowMajor<3, 6>> J(jacobians[1]);
      J.leftCols<3>() = across * d_rotation;
      J.rightCols<3>().setZero();
    }
    return true;
  }
};

}  // namespace holba
