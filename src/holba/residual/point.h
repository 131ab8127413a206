// SPDX-License-Identifier: BSD-3-Clause
// point: r = pi(C, X) - x, pixels, R^2 (paper, Eq. 1). Blocks: point (the feature), pose,
// intrinsics. Absent: the point has no image (behind the camera).
#pragma once

#include "holba/problem/vector_work.h"
#include "holba/residual/view.h"

namespace holba {

struct PointResidual {
  static constexpr int kDim = 2, kNumSlots = 3;
  struct Datum {
    Eigen::Vector2d observed;
    const SensorPose* sensor;  // null: the reference sensor of its rig
  };
  const CameraModel* model;

  bool Evaluate(const Datum& datum, const double* const* values, double* residual,
                double* const* jacobians) const {
    const Eigen::Map<const Eigen::Vector3d> X(values[0]);
    if (!AnyWanted(jacobians, 3)) {
      Eigen::Vector2d pixel;
      if (!ProjectPoint(*model, datum.sensor, values[1], values[2], X, &pixel)) return false;
      Eigen::Map<Eigen::Vector2d>{residual} = pixel - datum.observed;
      return true;
    }
    PointInImage image;
    if (!ProjectPoint(*model, datum.sensor, values[1], values[2], X, &image)) return false;
    Eigen::Map<Eigen::Vector2d>{residual} = image.pixel - datum.observed;
    if (jacobians[0]) Eigen::Map<RowMajor<2, 3>>{jacobians[0]} = image.d_point;
    if (jacobians[1]) Eigen::Map<RowMajor<2, 6>>{jacobians[1]} = image.d_pose;
    if (jacobians[2]) std::copy_n(image.d_params, 2 * model->num_params, jacobians[2]);
    return true;
  }

  // In packs (vectorised.h); false: not this one, nothing was done.
  bool EvaluateVectorised(const VectorWork& work) const;
};

}  // namespace holba
