// SPDX-License-Identifier: BSD-3-Clause
// Point-line incidences as reprojection errors; only one of the two features is a variable, the other's 2D observation is
// the measurement (paper, Eqs. 14 and 15). Ideal pixels, R.
//   wireframe_point: signed distance of pi(C, X) to the line through an observed segment of the edge's line, in an image that
//   does not observe the point. Blocks: point, pose, intrinsics. Absent: behind the camera, or no ideal end points.
//   wireframe_line: signed distance of an observation x of the edge's point to pi(C, L), in an image that does not observe the
//   line. Blocks: line, pose, intrinsics. Absent: x has no ideal pixel, or the line no direction in the image.
#pragma once

#include "holba/residual/line.h"
#include "holba/residual/view.h"

namespace holba {

struct WireframePointResidual {
  static constexpr int kDim = 1;
  using Datum = SegmentDatum;
  LineCamera camera;

  bool Evaluate(const Datum& datum, const double* const* values, double* residual,
                double* const* jacobians) const {
    const int num_params = camera.model->num_params;
    Eigen::Vector2d a, b;
    double d_a[2 * kMaxCameraParams], d_b[2 * kMaxCameraParams];
    const bool by_params = jacobians[2] != nullptr;
    if (!camera.Locate(datum.start, values[2], &a, by_params ? d_a : nullptr) ||
        !camera.Locate(datum.end, values[2], &b, by_params ? d_b : nullptr)) {
      return false;
    }
    const Eigen::Vector2d along = b - a;
    const double length = along.norm();
    if (!(length > 0.0)) return false;
    PointInImage image;
    const Eigen::Map<const Eigen::Vector3d> X(values[0]);
    if (!ProjectPointIdeal(*camera.model, datum.sensor, values[1], values[2], X, &image)) return false;
    const Eigen::Vector2d u = image.pixel - a;
    const Eigen::RowVector2d normal = Eigen::RowVector2d(-along.y(), along.x()) / length;
    residual[0] = normal.dot(u);
    if (jacobians[0]) Eigen::Map<RowMajor<1, 3>>{jacobians[0]} = normal * image.d_point;
    if (jacobians[1]) Eigen::Map<RowMajor<1, 6>>{jacobians[1]} = normal * image.d_pose;
    if (by_params) {
      // r = (along x u) / |along|
      const Eigen::RowVector2d d_along =
          Eigen::RowVector2d(u.y(), -u.x()) / length - residual[0] / (length * length) * along.transpose();
      for (int c = 0; c < num_params; ++c) {
        double d = normal.x() * image.d_params[c] + normal.y() * image.d_params[num_params + c];
        if (camera.observations_move) {
          const Eigen::Vector2d move_a(d_a[c], d_a[num_params + c]), move_b(d_b[c], d_b[num_params + c]);
          d += d_along.dot(move_b - move_a) - normal.dot(move_a);
        }
        jacobians[2][c] = d;
      }
    }
    return true;
  }
};

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
    const LineBlock block(values[0]);
    const IdealCalibration k = camera.model->ideal_calibration(values[2]);
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
