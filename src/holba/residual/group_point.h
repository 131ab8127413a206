// SPDX-License-Identifier: BSD-3-Clause
// group_point: r = pi(C, X) - pi(C, Proj_G(X)), pixels, R^2 (paper, Eq. 9). Blocks: point (the one
// feature), pose, intrinsics, group. Absent: Proj_G(X) is undefined, or X or Proj_G(X) has no
// image.
#pragma once

#include "holba/problem/vector_work.h"
#include "holba/residual/group_tangent.h"
#include "holba/residual/view.h"

namespace holba {

struct GroupPointResidual {
  static constexpr int kDim = 2, kNumSlots = 4;
  struct Datum {
    const SensorPose* sensor;
  };
  const CameraModel* model;
  const GroupType* type;

  bool Evaluate(const Datum& datum, const double* const* values, double* residual,
                double* const* jacobians) const {
    const Eigen::Map<const Eigen::Vector3d> X(values[0]);
    Eigen::Vector3d on_group;
    if (!AnyWanted(jacobians, 4)) {
      Eigen::Vector2d a, b;
      if (!type->project_point(values[3], X, &on_group) ||
          !ProjectPoint(*model, datum.sensor, values[1], values[2], X, &a) ||
          !ProjectPoint(*model, datum.sensor, values[1], values[2], on_group, &b)) {
        return false;
      }
      Eigen::Map<Eigen::Vector2d>{residual} = a - b;
      return true;
    }
    RowMajor<3, 3> d_point;
    double d_group[3 * kMaxGroupParams];
    if (!type->project_point_with_jacobian(values[3], X, &on_group, d_point.data(), d_group))
      return false;
    PointInImage a, b;
    if (!ProjectPoint(*model, datum.sensor, values[1], values[2], X, &a) ||
        !ProjectPoint(*model, datum.sensor, values[1], values[2], on_group, &b)) {
      return false;
    }
    Eigen::Map<Eigen::Vector2d>{residual} = a.pixel - b.pixel;
    if (jacobians[0]) Eigen::Map<RowMajor<2, 3>>{jacobians[0]} = a.d_point - b.d_point * d_point;
    if (jacobians[1]) Eigen::Map<RowMajor<2, 6>>{jacobians[1]} = a.d_pose - b.d_pose;
    if (jacobians[2]) {
      for (int i = 0; i < 2 * model->num_params; ++i)
        jacobians[2][i] = a.d_params[i] - b.d_params[i];
    }
    if (jacobians[3]) {
      const auto d = ByGroupTangent<3>(*type, values[3], d_group);
      Eigen::Map<Eigen::Matrix<double, 2, Eigen::Dynamic, Eigen::RowMajor>>(
          jacobians[3], 2, d.cols()) = -b.d_point.lazyProduct(d);
    }
    return true;
  }

  // In packs (vectorised.h); false: not this one, nothing was done.
  bool EvaluateVectorised(const VectorWork& work) const;
};

}  // namespace holba
