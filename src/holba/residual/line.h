// SPDX-License-Identifier: BSD-3-Clause
// line: r = rho(pi(C, L), l_obs), ideal pixels, R^4: the perpendicular vectors from both observed
// end points to the projected line (paper, Eq. 4). Blocks: line (the feature), pose, intrinsics.
// Absent: an end point has no ideal pixel; the projected line has no direction.
#pragma once

#include "holba/residual/view.h"

namespace holba {

struct SegmentDatum {
  IdealObservation start, end;
  const SensorPose* sensor;  // null: the reference sensor of its rig
};

struct LineResidual {
  static constexpr int kDim = 4;
  using Datum = SegmentDatum;
  LineCamera camera;

  bool Evaluate(const Datum& datum, const double* const* values, double* residual,
                double* const* jacobians) const {
    if (!AnyWanted(jacobians, 3)) {
      Eigen::Vector2d start, end;
      Eigen::Vector4d rho;
      if (!camera.Locate(datum.start, values[2], &start, nullptr) ||
          !camera.Locate(datum.end, values[2], &end, nullptr) ||
          !PerpendicularValues(
              ProjectLine(datum.sensor, values[1], camera.model->ideal_calibration(values[2]),
                          LineOf(values[0])),
              start, end, &rho)) {
        return false;
      }
      Eigen::Map<Eigen::Vector4d>{residual} = rho;
      return true;
    }
    const LineBlock block(values[0]);
    const IdealCalibration k = camera.model->ideal_calibration(values[2]);
    LineInImage image;
    ProjectLine(datum.sensor, values[1], k, block.line, &image);
    const int num_params = camera.model->num_params;
    const IdealObservation* ends[2] = {&datum.start, &datum.end};
    for (int e = 0; e < 2; ++e) {
      Eigen::Vector2d x;
      double d_params[2 * kMaxCameraParams];
      if (!camera.Locate(*ends[e], values[2], &x, jacobians[2] ? d_params : nullptr)) return false;
      Perpendicular rho;
      if (!rho.Set(image.l, x)) return false;
      Eigen::Map<Eigen::Vector2d>{residual + 2 * e} = rho.value;
      if (jacobians[0]) {
        Eigen::Map<RowMajor<2, 4>>{jacobians[0] + 8 * e} =
            rho.d_line * image.d_line * block.d_tangent;
      }
      if (jacobians[1])
        Eigen::Map<RowMajor<2, 6>>{jacobians[1] + 12 * e} = rho.d_line * image.d_pose;
      if (jacobians[2]) {
        double* J = jacobians[2] + 2 * num_params * e;
        std::fill_n(J, 2 * num_params, 0.0);
        AddCalibrationColumns<2>(k, rho.d_line * image.d_calibration, num_params, J);
        if (camera.observations_move) {
          for (int c = 0; c < num_params; ++c) {
            const Eigen::Vector2d d =
                rho.d_point * Eigen::Vector2d(d_params[c], d_params[num_params + c]);
            J[c] += d.x();
            J[num_params + c] += d.y();
          }
        }
      }
    }
    return true;
  }
};

}  // namespace holba
