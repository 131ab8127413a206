// SPDX-License-Identifier: BSD-3-Clause
// wireframe_line: signed distance of an observation x of the edge's point to pi(C, L), in an image
// that does not observe the line; the observation is the measurement (paper, Eq. 15). Ideal pixels,
// R. Blocks: line, pose, intrinsics. Absent: x has no ideal pixel, or the line no direction in the
// image.
#pragma once

#include "holba/problem/vector_work.h"
#include "holba/residual/view.h"

namespace holba {

struct WireframeLineResidual {
  static constexpr int kDim = 1, kNumSlots = 3;
  struct Datum {
    IdealObservation observed;
    const SensorPose* sensor;
  };
  LineCamera camera;

  bool Evaluate(const Datum& datum, const double* const* values, double* residual,
                double* const* jacobians) const {
    return datum.sensor ? EvaluateIn<true>(datum, values, residual, jacobians)
                        : EvaluateIn<false>(datum, values, residual, jacobians);
  }

  // In packs (vectorised.h); false: not this one, nothing was done.
  bool EvaluateVectorised(const VectorWork& work) const;

 private:
  template <bool kSensor>
  bool EvaluateIn(const Datum& datum, const double* const* values, double* residual,
                  double* const* jacobians) const {
    const int num_params = camera.model->num_params;
    Eigen::Vector2d x;
    double d_x[2 * kMaxCameraParams];
    if (!camera.Locate(datum.observed, values[2], &x, jacobians[2] ? d_x : nullptr)) return false;
    const IdealCalibration calibration = camera.model->ideal_calibration(values[2]);
    const CalibrationFormulas<double> k = FormulasOf(calibration);
    const auto view = ViewOf<kSensor>(datum.sensor, values[1]);
    LineFormulas<double> line;
    line.Set(values[0]);
    LineInView<double, kSensor> image;
    image.Set(k, view, line.d, line.m);
    if (!HasDirectionInImage(image.l)) return false;
    double by_l[3];
    DistanceFromLine(image.l, x.data(), residual, by_l);
    if (!AnyWanted(jacobians, 3)) return true;
    line.SetBasis();
    double by_d[3], by_m[3], by_pose[6], by_calibration[4];
    image.Pull(k, view, by_l, by_d, by_m, by_pose, by_calibration);
    if (jacobians[0]) line.Pull(by_d, by_m, jacobians[0]);
    if (jacobians[1]) std::copy_n(by_pose, 6, jacobians[1]);
    if (jacobians[2]) {
      WriteCalibrationRow(calibration, by_calibration, num_params, jacobians[2]);
      if (camera.observations_move) {
        const double by_point[2] = {by_l[2] * image.l[0], by_l[2] * image.l[1]};
        AddMove(by_point, d_x, num_params, jacobians[2]);
      }
    }
    return true;
  }
};

}  // namespace holba
