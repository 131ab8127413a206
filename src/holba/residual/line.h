// SPDX-License-Identifier: BSD-3-Clause
// line: r = rho(pi(C, L), l_obs), ideal pixels, R^4: the perpendicular vectors from both observed
// end points to the projected line (paper, Eq. 4). Blocks: line (the feature), pose, intrinsics.
// Absent: an end point has no ideal pixel; the projected line has no direction.
#pragma once

#include "holba/problem/vector_work.h"
#include "holba/residual/view.h"

namespace holba {

struct SegmentDatum {
  IdealObservation start, end;
  const SensorPose* sensor;  // null: the reference sensor of its rig
};

struct LineResidual {
  static constexpr int kDim = 4, kNumSlots = 3;
  using Datum = SegmentDatum;
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
    const bool wanted = AnyWanted(jacobians, 3);
    const IdealCalibration calibration = camera.model->ideal_calibration(values[2]);
    const CalibrationFormulas<double> k = FormulasOf(calibration);
    const auto view = ViewOf<kSensor>(datum.sensor, values[1]);
    LineFormulas<double> line;
    line.Set(values[0]);
    LineInView<double, kSensor> image;
    image.Set(k, view, line.d, line.m);
    if (!HasDirectionInImage(image.l)) return false;
    if (wanted) line.SetBasis();
    const int num_params = camera.model->num_params;
    const IdealObservation* ends[2] = {&datum.start, &datum.end};
    for (int e = 0; e < 2; ++e) {
      Eigen::Vector2d x;
      double d_params[2 * kMaxCameraParams];
      if (!camera.Locate(*ends[e], values[2], &x, jacobians[2] ? d_params : nullptr)) return false;
      PerpendicularFormulas<double> rho;
      rho.Set(image.l, x.data(), wanted);
      std::copy_n(rho.value, 2, residual + 2 * e);
      if (!wanted) continue;
      for (int row = 2 * e; row < 2 * e + 2; ++row) {
        const double* by_l = rho.by_l + 3 * (row - 2 * e);
        double by_d[3], by_m[3], by_pose[6], by_calibration[4];
        image.Pull(k, view, by_l, by_d, by_m, by_pose, by_calibration);
        if (jacobians[0]) line.Pull(by_d, by_m, jacobians[0] + 4 * row);
        if (jacobians[1]) std::copy_n(by_pose, 6, jacobians[1] + 6 * row);
        if (!jacobians[2]) continue;
        double* J = jacobians[2] + num_params * row;
        WriteCalibrationRow(calibration, by_calibration, num_params, J);
        if (camera.observations_move) {
          const double by_point[2] = {by_l[2] * image.l[0], by_l[2] * image.l[1]};
          AddMove(by_point, d_params, num_params, J);
        }
      }
    }
    return true;
  }
};

}  // namespace holba
