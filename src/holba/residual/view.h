// SPDX-License-Identifier: BSD-3-Clause
// Half of the chain rule: what a camera at a pose makes of a world point or line, with derivatives
// with respect to the feature, the pose (tangent of PoseManifold) and the intrinsics. Groups never
// appear here.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>

#include "holba/camera/camera_model.h"
#include "holba/geometry/line.h"
#include "holba/geometry/manifold.h"
#include "holba/geometry/types.h"
#include "holba/residual/formulas.h"

namespace holba {

// Pose of a sensor in its rig, x_sensor = R x_rig + t, that is held. One that is adjusted is a
// block (with_sensor_pose.h).
struct SensorPose {
  Eigen::Matrix3d rotation;
  Eigen::Vector3d translation;
};

inline Eigen::Matrix3d PoseRotation(const double* pose) {
  return Eigen::Quaterniond(pose[3], pose[0], pose[1], pose[2]).toRotationMatrix();
}

// Whether any Jacobian of the first `slots` blocks is wanted; trial steps want none, and half of
// the work can be left out.
inline bool AnyWanted(double* const* jacobians, int slots) {
  for (int s = 0; s < slots; ++s) {
    if (jacobians[s]) return true;
  }
  return false;
}

// The view of an image (formulas.h); kSensor: sensor is not null.
template <bool kSensor>
ViewFormulas<double, kSensor> ViewOf(const SensorPose* sensor, const double* pose) {
  ViewFormulas<double, kSensor> view;
  view.SetPose(pose);
  if constexpr (kSensor) view.SetSensor(sensor->rotation.data(), sensor->translation.data());
  return view;
}

// A camera of any model as SeePixel wants it.
struct CameraOfModel {
  const CameraModel& model;
  const double* params;

  bool Project(const double* in_cam, double* pixel, double* d_point, double* d_params) const {
    const Eigen::Vector3d x(in_cam[0], in_cam[1], in_cam[2]);
    Eigen::Vector2d at;
    const bool seen = d_point != nullptr || d_params != nullptr
                          ? model.project_with_jacobian(params, x, &at, d_point, d_params)
                          : model.project(params, x, &at);
    if (seen) Eigen::Map<Eigen::Vector2d>{pixel} = at;
    return seen;
  }
};

// A pixel of a world point, with its derivatives.
struct PointInImage {
  Eigen::Vector2d pixel;
  RowMajor<2, 3> d_point;
  RowMajor<2, 6> d_pose;
  double d_params[2 * kMaxCameraParams];
};

inline bool ProjectPoint(const CameraModel& model, const SensorPose* sensor, const double* pose,
                         const double* params, const Eigen::Vector3d& X, PointInImage* out) {
  const CameraOfModel camera{model, params};
  double *pixel = out->pixel.data(), *d_point = out->d_point.data(), *d_pose = out->d_pose.data();
  return sensor ? SeePixel(camera, ViewOf<true>(sensor, pose), X.data(), pixel, d_point, d_pose,
                           out->d_params)
                : SeePixel(camera, ViewOf<false>(sensor, pose), X.data(), pixel, d_point, d_pose,
                           out->d_params);
}

// The pixel alone.
inline bool ProjectPoint(const CameraModel& model, const SensorPose* sensor, const double* pose,
                         const double* params, const Eigen::Vector3d& X, Eigen::Vector2d* pixel) {
  const CameraOfModel camera{model, params};
  double* const unwanted = nullptr;
  return sensor ? SeePixel(camera, ViewOf<true>(sensor, pose), X.data(), pixel->data(), unwanted,
                           unwanted, unwanted)
                : SeePixel(camera, ViewOf<false>(sensor, pose), X.data(), pixel->data(), unwanted,
                           unwanted, unwanted);
}

inline CalibrationFormulas<double> FormulasOf(const IdealCalibration& k) {
  return {k.fx, k.fy, k.cx, k.cy};
}

// Image l of a world line (d, m): l . (x, y, 1) = 0 in ideal pixels.
inline Eigen::Vector3d ProjectLine(const SensorPose* sensor, const double* pose,
                                   const IdealCalibration& k, const Vector6d& line) {
  const double *d = line.data(), *m = line.data() + 3;
  const auto see = [&](auto image, const auto& view) {
    image.Set(FormulasOf(k), view, d, m);
    return Eigen::Vector3d(image.l[0], image.l[1], image.l[2]);
  };
  return sensor ? see(LineInView<double, true>(), ViewOf<true>(sensor, pose))
                : see(LineInView<double, false>(), ViewOf<false>(sensor, pose));
}

// A row by (fx, fy, cx, cy) as a row by the num_params parameters.
inline void WriteCalibrationRow(const IdealCalibration& k, const double* by_calibration,
                                int num_params, double* row) {
  std::fill_n(row, num_params, 0.0);
  const int idx[4] = {k.fx_idx, k.fy_idx, k.cx_idx, k.cy_idx};
  for (int c = 0; c < 4; ++c) {
    if (idx[c] >= 0) row[idx[c]] += by_calibration[c];
  }
}

// Adds to such a row what comes from an observed point that moves with the parameters: by_point (2)
// times d_params (2 x num_params).
inline void AddMove(const double* by_point, const double* d_params, int num_params, double* row) {
  for (int c = 0; c < num_params; ++c) {
    row[c] += by_point[0] * d_params[c] + by_point[1] * d_params[num_params + c];
  }
}

// An observed pixel in ideal pixels. Where intrinsics of a distorted camera move, it moves with
// them.
struct IdealObservation {
  Eigen::Vector2d pixel;  // as observed
  Eigen::Vector2d ideal;  // with the intrinsics of the start
  bool valid = false;     // `ideal` exists

  IdealObservation() = default;
  IdealObservation(const CameraModel& model, const double* params, const Eigen::Vector2d& observed)
      : pixel(observed), ideal(observed) {
    const auto found = IdealPixel(model, params, observed);
    valid = found.has_value();
    if (valid) ideal = *found;
  }
};

// The camera of a batch of line residuals.
struct LineCamera {
  const CameraModel* model = nullptr;
  // Ideal observations follow the intrinsics (distorted camera whose intrinsics are adjusted).
  bool observations_move = false;

  // d_params (2 x num_params) is written only if observations move and it is not null.
  bool Locate(const IdealObservation& observation, const double* params, Eigen::Vector2d* ideal,
              double* d_params) const {
    if (!observations_move) {
      *ideal = observation.ideal;
      return observation.valid;
    }
    const auto found = d_params
                           ? IdealPixelWithJacobian(*model, params, observation.pixel, d_params)
                           : IdealPixel(*model, params, observation.pixel);
    if (found) *ideal = *found;
    return found.has_value();
  }
};

// Both perpendicular vectors from the points to the line l, R^4. False: the line has no direction
// in the image (it is at infinity).
inline bool PerpendicularValues(const Eigen::Vector3d& l, const Eigen::Vector2d& start,
                                const Eigen::Vector2d& end, Eigen::Vector4d* values) {
  if (!HasDirectionInImage(l.data())) return false;
  PerpendicularFormulas<double> rho_start, rho_end;
  rho_start.Set(l.data(), start.data(), false);
  rho_end.Set(l.data(), end.data(), false);
  *values << rho_start.value[0], rho_start.value[1], rho_end.value[0], rho_end.value[1];
  return true;
}

}  // namespace holba
