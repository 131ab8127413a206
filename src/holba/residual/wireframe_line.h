// SPDX-License-Identifier: BSD-3-Clause
// wireframe_line: signed distance of an observation x of the edge's point to pi(C, L), in an image
// that does not observe the line; the observation is the measurement (paper, Eq. 15). Ideal pixels,
// R. Blocks: line, pose, intrinsics. Absent: x has no ideal pixel, or the line no direction in the
// image.
#pragma once

#include "holba/residual/view.h"

namespace holba {

struct WireframeLineResidual {
  static constexpr int kDim = 1;
  struct Datum {
    IdealObservation observed;
    const SensorPose* sensor;
  };
  LineCamera camera;

  bool Evaluate(const Datum& datum, const double* const* values, double* residual,
                double* const* jacobians) const {
    const int num_params = camera.model->num_params;
    Eigen::Vector2d x;
    double d_x[2 * kMaxCameraParams];
    if (!camera.Locate(datum.observed, values[2], &x, jacobians[2] ? d_x : nullptr)) return false;
    const IdealCalibration k = camera.model->ideal_calibration(values[2]);
    if (!AnyWanted(jacobians, 3)) {
      const Eigen::Vector3d l = ProjectLine(datum.sensor, values[1], k, LineOf(values[0]));
      const double q = l.head<2>().squaredNorm();
      if (!(q > 1e-24 * l.squaredNorm())) return false;
      residual[0] = (l.z() + l.head<2>().dot(x)) / std::sqrt(q);
      return true;
    }
    const LineBlock block(values[0]);
    LineInImage image;
    ProjectLine(datum.sensor, values[1], k, block.line, &image);
    const Eigen::RowVector2d n = image.l.head<2>().transpose();
    const double q = n.squaredNorm();
    if (!(q > 1e-24 * image.l.squaredNorm())) return false;
    const double inv_norm = 1.0 / std::sqrt(q);
    const Eigen::RowVector3d xh(x.x(), x.y(), 1.0);
    residual[0] = xh.dot(image.l.transpose()) * inv_norm;
    Eigen::RowVector3d by_l = xh * inv_norm;
    by_l.leftCols<2>() -= residual[0] / q * n;
    if (jacobians[0]) {
      Eigen::Map<RowMajor<1, 4>>{jacobians[0]} = by_l * image.d_line * block.d_tangent;
    }
    if (jacobians[1]) Eigen::Map<RowMajor<1, 6>>{jacobians[1]} = by_l * image.d_pose;
    if (jacobians[2]) {
      std::fill_n(jacobians[2], num_params, 0.0);
      AddCalibrationColumns<1>(k, by_l * image.d_calibration, num_params, jacobians[2]);
      if (camera.observations_move) {
        for (int c = 0; c < num_params; ++c) {
          jacobians[2][c] += inv_norm * (n.x() * d_x[c] + n.y() * d_x[num_params + c]);
        }
      }
    }
    return true;
  }
};

}  // namespace holba
