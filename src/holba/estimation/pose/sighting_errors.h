// SPDX-License-Identifier: BSD-3-Clause
// Errors of sightings for a pose and intrinsics, two numbers each:
//   point      pi(C, X) - x, pixels;
//   line       signed distances of the segment's ends from the image of the line, which goes on
//              without end, ideal pixels (residual/line.h);
//   direction  the seen direction in a basis across the predicted one, sine of the angle.
// All are divided by the sighting's relative sigma. There is none where a point is behind the
// camera, an end has no ideal pixel or sees the line behind itself.
#pragma once

#include <Eigen/Core>

#include "holba/estimation/pose/sightings.h"
#include "holba/geometry/rigid3d.h"
#include "holba/geometry/types.h"
#include "holba/scene/reconstruction.h"

namespace holba {

// A camera at a pose.
struct PosedCamera {
  PosedCamera(const CameraModel* camera_model, const double* camera_params, const Rigid3d& pose)
      : model{camera_model},
        params{camera_params},
        ideal{camera_model->ideal_calibration(camera_params)},
        R{pose.RotationMatrix()},
        t{pose.translation} {}

  const CameraModel* model;
  const double* params;
  IdealCalibration ideal;
  Eigen::Matrix3d R;
  Eigen::Vector3d t;
};

struct SightingJacobian {
  RowMajor<2, 6> pose;                  // tangent of PoseManifold
  double params[2 * kMaxCameraParams];  // 2 x num_params, row-major
};

// False: there is none. `jacobian` may be null.
bool ErrorOf(const PosedCamera& view, const PointSighting& sighting, Eigen::Vector2d* error,
             SightingJacobian* jacobian);
bool ErrorOf(const PosedCamera& view, const LineSighting& sighting, Eigen::Vector2d* error,
             SightingJacobian* jacobian);
// `given`: the calibration for which the direction in the camera holds.
bool ErrorOf(const PosedCamera& view, const IdealCalibration& given,
             const DirectionSighting& sighting, Eigen::Vector2d* error, SightingJacobian* jacobian);

// The direction that has under `now` the ideal pixel that `in_cam` has under `given`; unit.
Eigen::Vector3d UnderCalibration(const Eigen::Vector3d& in_cam, const IdealCalibration& given,
                                 const IdealCalibration& now);

// Whether the ray meets the line's nearest point in front of the camera; both in its frame.
inline bool IsInFront(const PlueckerLine& line, const Eigen::Vector3d& ray) {
  return ray.cross(line.direction).dot(line.moment) > 0.0;
}

}  // namespace holba
