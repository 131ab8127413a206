// SPDX-License-Identifier: BSD-3-Clause
// depth_prior: r = (log z - log D - s) / sigma, no unit, R^1: what a network of monocular depth
// says of a point that an image sees. z is the point's depth in that image, D what the network says
// there, s the logarithm of the image's scale, which such a network does not know. Logarithms, as
// its errors grow with the depth. Blocks: point (the one feature), pose, scale of the image.
// Absent: the point is not in front of the camera.
#pragma once

#include <Eigen/Core>
#include <cmath>

#include "holba/geometry/types.h"
#include "holba/residual/view.h"

namespace holba::example {

struct DepthPriorResidual {
  static constexpr int kDim = 1, kNumSlots = 3;
  struct Datum {
    double log_depth;  // of D
  };
  double sigma;  // relative error of D, standard deviation

  bool Evaluate(const Datum& datum, const double* const* values, double* residual,
                double* const* jacobians) const {
    const Eigen::Map<const Eigen::Vector3d> X(values[0]);
    const Eigen::Matrix3d R = PoseRotation(values[1]);
    const Eigen::Vector3d turned = R * X;
    const double z = turned.z() + values[1][6];
    if (!(z > 0.0)) return false;
    residual[0] = (std::log(z) - datum.log_depth - values[2][0]) / sigma;
    const double by_depth = 1.0 / (z * sigma);
    if (jacobians[0]) Eigen::Map<RowMajor<1, 3>>{jacobians[0]} = by_depth * R.row(2);
    // A rotation vector w turns R X by w x R X, whose third number is w_x (R X)_y - w_y (R X)_x.
    if (jacobians[1]) {
      Eigen::Map<RowMajor<1, 6>>{jacobians[1]} << by_depth * turned.y(), -by_depth * turned.x(),
          0.0, 0.0, 0.0, by_depth;
    }
    if (jacobians[2]) jacobians[2][0] = -1.0 / sigma;
    return true;
  }
};

}  // namespace holba::example
