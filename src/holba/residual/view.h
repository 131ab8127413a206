// SPDX-License-Identifier: BSD-3-Clause
// Half of the chain rule: what a camera at a pose makes of a world point or line, with derivatives
// with respect to the feature, the pose (tangent of PoseManifold) and the intrinsics. Groups never
// appear here.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cmath>

#include "holba/camera/camera_model.h"
#include "holba/geometry/line.h"
#include "holba/geometry/manifold.h"
#include "holba/geometry/types.h"

namespace holba {

// Pose of a sensor in its rig, x_sensor = R x_rig + t. Constant in every problem.
struct SensorPose {
  Eigen::Matrix3d rotation;
  Eigen::Vector3d translation;
};

// Depths below this share of the distance to the camera count as behind it: the pixel would be at
// the horizon (less than 6e-5 degrees from 90 degrees off the axis).
inline constexpr double kMinRelativeDepth = 1e-6;

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

// x_cam of a world point.
inline Eigen::Vector3d ToCamera(const SensorPose* sensor, const double* pose,
                                const Eigen::Vector3d& X) {
  const Eigen::Vector3d x = PoseRotation(pose) * X + Eigen::Vector3d(pose[4], pose[5], pose[6]);
  return sensor ? Eigen::Vector3d(sensor->rotation * x + sensor->translation) : x;
}

// The same with its derivatives.
struct PointInCamera {
  Eigen::Vector3d x;
  Eigen::Matrix3d d_point;
  Eigen::Matrix<double, 3, 6> d_pose;

  PointInCamera(const SensorPose* sensor, const double* pose, const Eigen::Vector3d& X) {
    const Eigen::Matrix3d R = PoseRotation(pose);
    const Eigen::Vector3d rotated = R * X;
    x = rotated + Eigen::Vector3d(pose[4], pose[5], pose[6]);
    d_point = R;
    d_pose.leftCols<3>() = -CrossMatrix(rotated);
    d_pose.rightCols<3>().setIdentity();
    if (sensor) {
      x = sensor->rotation * x + sensor->translation;
      d_point = sensor->rotation * R;
      d_pose = sensor->rotation * d_pose.eval();
    }
  }
};

// A pixel, or an ideal pixel, of a world point.
struct PointInImage {
  Eigen::Vector2d pixel;
  RowMajor<2, 3> d_point;
  RowMajor<2, 6> d_pose;
  double d_params[2 * kMaxCameraParams];
};

inline bool ProjectPoint(const CameraModel& model, const SensorPose* sensor, const double* pose,
                         const double* params, const Eigen::Vector3d& X, PointInImage* out) {
  const PointInCamera in_cam(sensor, pose, X);
  RowMajor<2, 3> d_cam;
  if (!model.project_with_jacobian(params, in_cam.x, &out->pixel, d_cam.data(), out->d_params)) {
    return false;
  }
  out->d_point = d_cam * in_cam.d_point;
  out->d_pose = d_cam * in_cam.d_pose;
  return true;
}

// The pixel alone.
inline bool ProjectPoint(const CameraModel& model, const SensorPose* sensor, const double* pose,
                         const double* params, const Eigen::Vector3d& X, Eigen::Vector2d* pixel) {
  return model.project(params, ToCamera(sensor, pose, X), pixel);
}

inline bool ProjectPointIdeal(const CameraModel& model, const SensorPose* sensor,
                              const double* pose, const double* params, const Eigen::Vector3d& X,
                              Eigen::Vector2d* pixel) {
  const Eigen::Vector3d x = ToCamera(sensor, pose, X);
  if (!(x.z() > kMinRelativeDepth * x.norm())) return false;
  const IdealCalibration k = model.ideal_calibration(params);
  *pixel << k.fx * x.x() / x.z() + k.cx, k.fy * x.y() / x.z() + k.cy;
  return true;
}

// In ideal pixels (fx x/z + cx, fy y/z + cy); d_params has the model's num_params columns.
inline bool ProjectPointIdeal(const CameraModel& model, const SensorPose* sensor,
                              const double* pose, const double* params, const Eigen::Vector3d& X,
                              PointInImage* out) {
  const PointInCamera in_cam(sensor, pose, X);
  const Eigen::Vector3d& x = in_cam.x;
  if (!(x.z() > kMinRelativeDepth * x.norm())) return false;
  const IdealCalibration k = model.ideal_calibration(params);
  const double inv_z = 1.0 / x.z();
  const double u = x.x() * inv_z, v = x.y() * inv_z;
  out->pixel << k.fx * u + k.cx, k.fy * v + k.cy;
  RowMajor<2, 3> d_cam;
  d_cam << k.fx * inv_z, 0.0, -k.fx * u * inv_z, 0.0, k.fy * inv_z, -k.fy * v * inv_z;
  out->d_point = d_cam * in_cam.d_point;
  out->d_pose = d_cam * in_cam.d_pose;
  const int n = model.num_params;
  std::fill_n(out->d_params, 2 * n, 0.0);
  if (k.fx_idx >= 0) out->d_params[k.fx_idx] = u;
  if (k.fy_idx >= 0) out->d_params[n + k.fy_idx] = v;
  if (k.cx_idx >= 0) out->d_params[k.cx_idx] = 1.0;
  if (k.cy_idx >= 0) out->d_params[n + k.cy_idx] = 1.0;
  return true;
}

// Image l of a world line (d, m): l . (x, y, 1) = 0 in ideal pixels; l = K_l m_c, K_l the cofactors
// of K.
struct LineInImage {
  Eigen::Vector3d l;
  RowMajor<3, 6> d_line;
  RowMajor<3, 6> d_pose;
  RowMajor<3, 4> d_calibration;  // fx fy cx cy
};

inline void ProjectLine(const SensorPose* sensor, const double* pose, const IdealCalibration& k,
                        const Vector6d& line, LineInImage* out) {
  const Eigen::Matrix3d R = PoseRotation(pose);
  const Eigen::Vector3d t(pose[4], pose[5], pose[6]);
  const Eigen::Vector3d d = R * line.head<3>();
  const Eigen::Vector3d Rm = R * line.tail<3>();
  Eigen::Vector3d m = Rm + t.cross(d);
  const Eigen::Matrix3d cross_d = CrossMatrix(d);
  const Eigen::Matrix3d cross_t = CrossMatrix(t);
  RowMajor<3, 6> dm_line, dm_pose;
  dm_line.leftCols<3>() = cross_t * R;
  dm_line.rightCols<3>() = R;
  dm_pose.leftCols<3>() = -CrossMatrix(Rm) - cross_t * cross_d;
  dm_pose.rightCols<3>() = -cross_d;
  if (sensor) {
    // m_c = Rs m_r + ts x (Rs d_r)
    const Eigen::Matrix3d& Rs = sensor->rotation;
    const Eigen::Matrix3d across = CrossMatrix(sensor->translation) * Rs;
    m = (Rs * m + across * d).eval();
    dm_line = (Rs * dm_line).eval();
    dm_line.leftCols<3>() += across * R;
    dm_pose = (Rs * dm_pose).eval();
    dm_pose.leftCols<3>() -= across * cross_d;
  }
  Eigen::Matrix3d cofactor;
  cofactor << k.fy, 0.0, 0.0, 0.0, k.fx, 0.0, -k.fy * k.cx, -k.fx * k.cy, k.fx * k.fy;
  out->l = cofactor * m;
  out->d_line = cofactor * dm_line;
  out->d_pose = cofactor * dm_pose;
  out->d_calibration << 0.0, m.x(), 0.0, 0.0,  //
      m.y(), 0.0, 0.0, 0.0,                    //
      -k.cy * m.y() + k.fy * m.z(), -k.cx * m.x() + k.fx * m.z(), -k.fy * m.x(), -k.fx * m.y();
}

// The line alone.
inline Eigen::Vector3d ProjectLine(const SensorPose* sensor, const double* pose,
                                   const IdealCalibration& k, const Vector6d& line) {
  const Eigen::Matrix3d R = PoseRotation(pose);
  Eigen::Vector3d d = R * line.head<3>();
  Eigen::Vector3d m = R * line.tail<3>() + Eigen::Vector3d(pose[4], pose[5], pose[6]).cross(d);
  if (sensor) {
    d = (sensor->rotation * d).eval();
    m = (sensor->rotation * m + sensor->translation.cross(d)).eval();
  }
  return {k.fy * m.x(), k.fx * m.y(),
          -k.fy * k.cx * m.x() - k.fx * k.cy * m.y() + k.fx * k.fy * m.z()};
}

// Adds d * d(calibration)/d(params) to a Jacobian of `rows` rows and num_params columns.
template <int Rows>
void AddCalibrationColumns(const IdealCalibration& k, const Eigen::Matrix<double, Rows, 4>& d,
                           int num_params, double* jacobian) {
  const int idx[4] = {k.fx_idx, k.fy_idx, k.cx_idx, k.cy_idx};
  for (int c = 0; c < 4; ++c) {
    if (idx[c] < 0) continue;
    for (int row = 0; row < Rows; ++row) jacobian[row * num_params + idx[c]] += d(row, c);
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

// (d, m) of a line block [d p], m = p x d.
inline Vector6d LineOf(const double* values) {
  const Eigen::Vector3d d(values[0], values[1], values[2]), p(values[3], values[4], values[5]);
  Vector6d line;
  line << d, p.cross(d);
  return line;
}

// The same with d(d, m)/d(tangent of LineManifold).
struct LineBlock {
  Vector6d line;
  Eigen::Matrix<double, 6, 4> d_tangent;

  explicit LineBlock(const double* values) {
    const Eigen::Vector3d d(values[0], values[1], values[2]), p(values[3], values[4], values[5]);
    line = LineOf(values);
    const Eigen::Matrix<double, 3, 2> basis = TangentBasis(d);
    d_tangent.topLeftCorner<3, 2>() = basis;
    d_tangent.topRightCorner<3, 2>().setZero();
    d_tangent.bottomLeftCorner<3, 2>() = CrossMatrix(p) * basis;
    d_tangent.bottomRightCorner<3, 2>() = -CrossMatrix(d) * basis;
  }
};

// Perpendicular vector from an observed (ideal) point x to the line l: (l.x) / (l1^2 + l2^2) (l1,
// l2).
struct Perpendicular {
  Eigen::Vector2d value;
  RowMajor<2, 3> d_line;
  RowMajor<2, 2> d_point;

  // False: the line has no direction in the image (it is at infinity).
  bool Set(const Eigen::Vector3d& l, const Eigen::Vector2d& x) {
    const Eigen::Vector2d n = l.head<2>();
    const double q = n.squaredNorm();
    if (!(q > 1e-24 * l.squaredNorm())) return false;
    const Eigen::Vector3d xh(x.x(), x.y(), 1.0);
    const double s = l.dot(xh) / q;
    value = s * n;
    d_line = n * xh.transpose() / q;
    d_line.leftCols<2>() += s * Eigen::Matrix2d::Identity() - (2.0 * s / q) * n * n.transpose();
    d_point = n * n.transpose() / q;
    return true;
  }
};

// Both perpendicular vectors alone, R^4. False: as Perpendicular::Set.
inline bool PerpendicularValues(const Eigen::Vector3d& l, const Eigen::Vector2d& start,
                                const Eigen::Vector2d& end, Eigen::Vector4d* values) {
  const Eigen::Vector2d n = l.head<2>();
  const double q = n.squaredNorm();
  if (!(q > 1e-24 * l.squaredNorm())) return false;
  *values << (l.z() + n.dot(start)) / q * n, (l.z() + n.dot(end)) / q * n;
  return true;
}

}  // namespace holba
