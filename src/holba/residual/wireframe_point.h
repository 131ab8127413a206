// SPDX-License-Identifier: BSD-3-Clause
// wireframe_point: signed distance of pi(C, X) to the line through an observed segment of the
// edge's line, in an image that does not observe the point; the segment is the measurement (paper,
// Eq. 14). Ideal pixels, R. Blocks: point, pose, intrinsics. Absent: behind the camera, or no ideal
// end points.
#pragma once

#include "holba/problem/vector_work.h"
#include "holba/residual/line.h"
#include "holba/residual/view.h"

namespace holba {

struct WireframePointResidual {
  static constexpr int kDim = 1, kNumSlots = 3;
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
    const int num_params = camera.model->num_params;
    Eigen::Vector2d start, end;
    double d_start[2 * kMaxCameraParams], d_end[2 * kMaxCameraParams];
    const bool by_params = jacobians[2] != nullptr;
    if (!camera.Locate(datum.start, values[2], &start, by_params ? d_start : nullptr) ||
        !camera.Locate(datum.end, values[2], &end, by_params ? d_end : nullptr)) {
      return false;
    }
    const IdealCalibration calibration = camera.model->ideal_calibration(values[2]);
    DistanceFromSegment<double, kSensor> distance;
    if (!distance.Set(FormulasOf(calibration), ViewOf<kSensor>(datum.sensor, values[1]), values[0],
                      start.data(), end.data(), AnyWanted(jacobians, 3))) {
      return false;
    }
    residual[0] = distance.value;
    if (jacobians[0]) std::copy_n(distance.by_point, 3, jacobians[0]);
    if (jacobians[1]) std::copy_n(distance.by_pose, 6, jacobians[1]);
    if (by_params) {
      WriteCalibrationRow(calibration, distance.by_calibration, num_params, jacobians[2]);
      if (camera.observations_move) {
        AddMove(distance.by_start, d_start, num_params, jacobians[2]);
        AddMove(distance.by_end, d_end, num_params, jacobians[2]);
      }
    }
    return true;
  }
};

}  // namespace holba
