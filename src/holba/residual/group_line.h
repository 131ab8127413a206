// SPDX-License-Identifier: BSD-3-Clause
// group_line: r = rho(pi(C, L), l_obs) - rho(pi(C, Proj_G(L)), l_obs), ideal pixels, R^4 (paper,
// Eq. 10). Blocks: line (the one feature), pose, intrinsics, group. Absent: Proj_G(L) is undefined
// (a line along the plane's normal), an end point has no ideal pixel, or either line has no
// direction in the image.
#pragma once

#include "holba/residual/group_tangent.h"
#include "holba/residual/line.h"

namespace holba {

struct GroupLineResidual {
  static constexpr int kDim = 4;
  using Datum = SegmentDatum;
  LineCamera camera;
  const GroupType* type;

  bool Evaluate(const Datum& datum, const double* const* values, double* residual,
                double* const* jacobians) const {
    Vector6d on_group;
    if (!AnyWanted(jacobians, 4)) {
      const Vector6d line = LineOf(values[0]);
      const IdealCalibration k = camera.model->ideal_calibration(values[2]);
      Eigen::Vector2d start, end;
      Eigen::Vector4d rho_a, rho_b;
      if (!type->project_line(values[3], line, &on_group) ||
          !camera.Locate(datum.start, values[2], &start, nullptr) ||
          !camera.Locate(datum.end, values[2], &end, nullptr) ||
          !PerpendicularValues(ProjectLine(datum.sensor, values[1], k, line), start, end, &rho_a) ||
          !PerpendicularValues(ProjectLine(datum.sensor, values[1], k, on_group), start, end,
                               &rho_b)) {
        return false;
      }
      Eigen::Map<Eigen::Vector4d>{residual} = rho_a - rho_b;
      return true;
    }
    const LineBlock block(values[0]);
    RowMajor<6, 6> d_line;
    double d_group[6 * kMaxGroupParams];
    if (!type->project_line_with_jacobian(values[3], block.line, &on_group, d_line.data(), d_group))
      return false;
    const IdealCalibration k = camera.model->ideal_calibration(values[2]);
    LineInImage a, b;
    ProjectLine(datum.sensor, values[1], k, block.line, &a);
    ProjectLine(datum.sensor, values[1], k, on_group, &b);
    const int num_params = camera.model->num_params;
    const int group_tangent = type->manifold->tangent;
    const IdealObservation* ends[2] = {&datum.start, &datum.end};
    for (int e = 0; e < 2; ++e) {
      Eigen::Vector2d x;
      double d_params[2 * kMaxCameraParams];
      if (!camera.Locate(*ends[e], values[2], &x, jacobians[2] ? d_params : nullptr)) return false;
      Perpendicular rho_a, rho_b;
      if (!rho_a.Set(a.l, x) || !rho_b.Set(b.l, x)) return false;
      Eigen::Map<Eigen::Vector2d>{residual + 2 * e} = rho_a.value - rho_b.value;
      const RowMajor<2, 6> b_by_line = rho_b.d_line * b.d_line;
      if (jacobians[0]) {
        Eigen::Map<RowMajor<2, 4>>{jacobians[0] + 8 * e} =
            (rho_a.d_line * a.d_line - b_by_line * d_line) * block.d_tangent;
      }
      if (jacobians[1]) {
        Eigen::Map<RowMajor<2, 6>>{jacobians[1] + 12 * e} =
            rho_a.d_line * a.d_pose - rho_b.d_line * b.d_pose;
      }
      if (jacobians[2]) {
        double* J = jacobians[2] + 2 * num_params * e;
        std::fill_n(J, 2 * num_params, 0.0);
        AddCalibrationColumns<2>(k, rho_a.d_line * a.d_calibration - rho_b.d_line * b.d_calibration,
                                 num_params, J);
        if (camera.observations_move) {
          const Eigen::Matrix2d by_end = rho_a.d_point - rho_b.d_point;
          for (int c = 0; c < num_params; ++c) {
            const Eigen::Vector2d d =
                by_end * Eigen::Vector2d(d_params[c], d_params[num_params + c]);
            J[c] += d.x();
            J[num_params + c] += d.y();
          }
        }
      }
      if (jacobians[3]) {
        const auto d = ByGroupTangent<6>(*type, values[3], d_group);
        Eigen::Map<Eigen::Matrix<double, 2, Eigen::Dynamic, Eigen::RowMajor>>(
            jacobians[3] + 2 * group_tangent * e, 2, group_tangent) = -b_by_line.lazyProduct(d);
      }
    }
    return true;
  }
};

}  // namespace holba
