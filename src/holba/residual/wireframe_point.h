// SPDX-License-Identifier: BSD-3-Clause
// wireframe_point: signed distance of pi(C, X) to the line through an observed segment of the
// edge's line, in an image that does not observe the point; the segment is the measurement (paper,
// Eq. 14). Ideal pixels, R. Blocks: point, pose, intrinsics. Absent: behind the camera, or no ideal
// end points.
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
    const Eigen::Map<const Eigen::Vector3d> X(values[0]);
    if (!AnyWanted(jacobians, 3)) {
      Eigen::Vector2d pixel;
      if (!ProjectPointIdeal(*camera.model, datum.sensor, values[1], values[2], X, &pixel))
        return false;
      const Eigen::Vector2d u = pixel - a;
      residual[0] = (along.x() * u.y() - along.y() * u.x()) / length;
      return true;
    }
    PointInImage image;
    if (!ProjectPointIdeal(*camera.model, datum.sensor, values[1], values[2], X, &image))
      return false;
    const Eigen::Vector2d u = image.pixel - a;
    const Eigen::RowVector2d normal = Eigen::RowVector2d(-along.y(), along.x()) / length;
    residual[0] = normal.dot(u);
    if (jacobians[0]) Eigen::Map<RowMajor<1, 3>>{jacobians[0]} = normal * image.d_point;
    if (jacobians[1]) Eigen::Map<RowMajor<1, 6>>{jacobians[1]} = normal * image.d_pose;
    if (by_params) {
      // r = (along x u) / |along|
      const Eigen::RowVector2d d_along = Eigen::RowVector2d(u.y(), -u.x()) / length -
                                         residual[0] / (length * length) * along.transpose();
      for (int c = 0; c < num_params; ++c) {
        double d = normal.x() * image.d_params[c] + normal.y() * image.d_params[num_params + c];
        if (camera.observations_move) {
          const Eigen::Vector2d move_a(d_a[c], d_a[num_params + c]),
              move_b(d_b[c], d_b[num_params + c]);
          d += d_along.dot(move_b - move_a) - normal.dot(move_a);
        }
        jacobians[2][c] = d;
      }
    }
    return true;
  }
};

}  // namespace holba
