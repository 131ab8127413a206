// SPDX-License-Identifier: BSD-3-Clause
// group_line: r = rho(pi(C, L), l_obs) - rho(pi(C, Proj_G(L)), l_obs), ideal pixels, R^4 (paper,
// Eq. 10). Blocks: line (the one feature), pose, intrinsics, group. Absent: Proj_G(L) is undefined
// (a line along the plane's normal), an end point has no ideal pixel, or either line has no
// direction in the image.
#pragma once

#include "holba/problem/vector_work.h"
#include "holba/residual/group_tangent.h"
#include "holba/residual/line.h"

namespace holba {

struct GroupLineResidual {
  static constexpr int kDim = 4, kNumSlots = 4;
  using Datum = SegmentDatum;
  LineCamera camera;
  const GroupType* type;

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
    const bool wanted = AnyWanted(jacobians, 4);
    LineFormulas<double> line;
    line.Set(values[0]);
    Vector6d world, on_group;
    world << line.d[0], line.d[1], line.d[2], line.m[0], line.m[1], line.m[2];
    RowMajor<6, 6> d_line;
    double d_group[6 * kMaxGroupParams];
    if (!(wanted ? type->project_line_with_jacobian(values[3], world, &on_group, d_line.data(),
                                                    d_group)
                 : type->project_line(values[3], world, &on_group))) {
      return false;
    }
    const IdealCalibration calibration = camera.model->ideal_calibration(values[2]);
    const CalibrationFormulas<double> k = FormulasOf(calibration);
    const auto view = ViewOf<kSensor>(datum.sensor, values[1]);
    LineInView<double, kSensor> a, b;
    a.Set(k, view, line.d, line.m);
    b.Set(k, view, on_group.data(), on_group.data() + 3);
    if (!HasDirectionInImage(a.l) || !HasDirectionInImage(b.l)) return false;
    const int num_params = camera.model->num_params;
    const int group_tangent = type->manifold->tangent;
    Eigen::Matrix<double, 6, Eigen::Dynamic, 0, 6, kMaxGroupParams> by_tangent;
    if (jacobians[0]) line.SetBasis();
    if (jacobians[3]) by_tangent = ByGroupTangent<6>(*type, values[3], d_group);
    const IdealObservation* ends[2] = {&datum.start, &datum.end};
    for (int e = 0; e < 2; ++e) {
      Eigen::Vector2d x;
      double d_params[2 * kMaxCameraParams];
      if (!camera.Locate(*ends[e], values[2], &x, jacobians[2] ? d_params : nullptr)) return false;
      PerpendicularFormulas<double> rho_a, rho_b;
      rho_a.Set(a.l, x.data(), wanted);
      rho_b.Set(b.l, x.data(), wanted);
      for (int i = 0; i < 2; ++i) residual[2 * e + i] = rho_a.value[i] - rho_b.value[i];
      if (!wanted) continue;
      for (int row = 2 * e; row < 2 * e + 2; ++row) {
        const double* a_by_l = rho_a.by_l + 3 * (row - 2 * e);
        const double* b_by_l = rho_b.by_l + 3 * (row - 2 * e);
        Eigen::Matrix<double, 1, 6> by_line, by_on_group, pose_a, pose_b;
        double calibration_a[4], calibration_b[4];
        a.Pull(k, view, a_by_l, by_line.data(), by_line.data() + 3, pose_a.data(), calibration_a);
        b.Pull(k, view, b_by_l, by_on_group.data(), by_on_group.data() + 3, pose_b.data(),
               calibration_b);
        if (jacobians[0]) {
          by_line -= by_on_group * d_line;
          line.Pull(by_line.data(), by_line.data() + 3, jacobians[0] + 4 * row);
        }
        if (jacobians[1]) {
          Eigen::Map<Eigen::Matrix<double, 1, 6>>{jacobians[1] + 6 * row} = pose_a - pose_b;
        }
        if (jacobians[2]) {
          double* J = jacobians[2] + num_params * row;
          for (int c = 0; c < 4; ++c) calibration_a[c] -= calibration_b[c];
          WriteCalibrationRow(calibration, calibration_a, num_params, J);
          if (camera.observations_move) {
            const double by_end[2] = {a_by_l[2] * a.l[0] - b_by_l[2] * b.l[0],
                                      a_by_l[2] * a.l[1] - b_by_l[2] * b.l[1]};
            AddMove(by_end, d_params, num_params, J);
          }
        }
        if (jacobians[3]) {
          Eigen::Map<Eigen::RowVectorXd>(jacobians[3] + group_tangent * row, group_tangent) =
              -by_on_group.lazyProduct(by_tangent);
        }
      }
    }
    return true;
  }
};

}  // namespace holba
