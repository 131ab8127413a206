// SPDX-License-Identifier: BSD-3-Clause
// principal_point_prior: r = (c - c_0) / sigma of a camera's principal point c (px), each
// coordinate in the standard deviation of what is known of it before. Block: the camera's
// intrinsics. Always present.
#pragma once

#include <Eigen/Core>
#include <algorithm>

#include "holba/camera/camera_model.h"

namespace holba {

struct PrincipalPointPrior {
  static constexpr int kDim = 2;
  struct Datum {
    Eigen::Vector2d known_px;
    Eigen::Vector2d sigma_px;
  };
  const CameraModel* model;

  bool Evaluate(const Datum& datum, const double* const* values, double* residual,
                double* const* jacobians) const {
    if (jacobians[0]) std::fill_n(jacobians[0], kDim * model->num_params, 0.0);
    for (int k = 0; k < kDim; ++k) {
      const int idx = model->principal_point_idxs[k];
      residual[k] = (values[0][idx] - datum.known_px[k]) / datum.sigma_px[k];
      if (jacobians[0]) jacobians[0][k * model->num_params + idx] = 1.0 / datum.sigma_px[k];
    }
    return true;
  }
};

}  // namespace holba
