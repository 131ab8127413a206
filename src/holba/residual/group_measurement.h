// SPDX-License-Identifier: BSD-3-Clause
// group_measurement: r = (R a) x u / sigma, R^3, without unit: a the direction of a group, u the
// same as measured in the camera frame (a vanishing point seen in an image, a plane normal from a
// monocular network), sigma in radians. Blocks: group, pose. Always present.
#pragma once

#include "holba/residual/group_direction.h"
#include "holba/residual/view.h"

namespace holba {

struct GroupMeasurementResidual {
  static constexpr int kDim = 3, kNumSlots = 2;
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
