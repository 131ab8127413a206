// SPDX-License-Identifier: BSD-3-Clause
// What several group types need: checks of the plain parameters of a file, rotations on any scalar,
// and derivatives with respect to a quaternion block.
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <limits>
#include <optional>

#include "holba/geometry/manifold.h"
#include "holba/geometry/rigid3d.h"
#include "holba/geometry/types.h"

namespace holba {

// A file's unit vector or quaternion may be off unit length by this much, and a Pluecker line off
// d.m = 0.
inline constexpr double kFileUnitTolerance = 1e-6;

// Nearer to a centre or an axis than this fraction of the radius (of the axial distance, for a
// cone) a point has no projection: its direction is rounding, and the derivative would exceed 1e9.
inline constexpr double kMinRadialFraction = 1e-9;

// Parameters in memory of a group on this manifold.
template <typename T, typename Manifold>
using GroupParams = Eigen::Matrix<T, Manifold::kAmbient, 1>;

// A direction, and a point, under a similarity, on any scalar.
template <typename T>
Vector3<T> Rotated(const Sim3d& new_from_old, const Vector3<T>& v) {
  return new_from_old.rotation.cast<T>() * v;
}
template <typename T>
Vector3<T> Moved(const Sim3d& new_from_old, const Vector3<T>& X) {
  return new_from_old.scale * Rotated(new_from_old, X) + new_from_old.translation.cast<T>();
}

inline bool AllFinite(const double* values, int num) {
  for (int i = 0; i < num; ++i) {
    if (!std::isfinite(values[i])) return false;
  }
  return true;
}

// Finite and large enough that its logarithm brings it back.
inline bool IsPositive(double value) {
  return std::isfinite(value) && value >= std::numeric_limits<double>::min();
}

// Factor that makes v unit; exactly 1 where it is unit up to rounding, so that a file read and
// written again does not drift. Empty: not a unit vector.
template <int N>
std::optional<double> ScaleToUnit(const Eigen::Matrix<double, N, 1>& v) {
  const double norm = v.norm();
  if (!(std::abs(norm - 1.0) <= kFileUnitTolerance)) return std::nullopt;
  return std::abs(norm - 1.0) <= 4.0 * std::numeric_limits<double>::epsilon() ? 1.0 : 1.0 / norm;
}

// In-memory x y z w of a file's w x y z. Empty: not a unit quaternion.
inline std::optional<Eigen::Vector4d> QuaternionFromFile(const double* wxyz) {
  const Eigen::Vector4d q(wxyz[1], wxyz[2], wxyz[3], wxyz[0]);
  const std::optional<double> scale = ScaleToUnit<4>(q);
  if (!scale) return std::nullopt;
  return Eigen::Vector4d(*scale * q);
}

template <typename T>
void QuaternionToFile(const T* xyzw, T* wxyz) {
  wxyz[0] = xyzw[3];
  for (int i = 0; i < 3; ++i) wxyz[1 + i] = xyzw[i];
}

// Rotation matrix of the unit quaternion [x y z w].
template <typename T>
Matrix3<T> RotationFromXyzw(const T* q) {
  const T x2 = q[0] + q[0], y2 = q[1] + q[1], z2 = q[2] + q[2];
  const T xx = x2 * q[0], yy = y2 * q[1], zz = z2 * q[2];
  const T xy = x2 * q[1], xz = x2 * q[2], yz = y2 * q[2];
  const T wx = x2 * q[3], wy = y2 * q[3], wz = z2 * q[3];
  Matrix3<T> R;
  R << T(1) - yy - zz, xy - wz, xz + wy, xy + wz, T(1) - xx - zz, yz - wx, xz - wy, yz + wx,
      T(1) - xx - yy;
  return R;
}

// d/dq (Rows x 4) of what has derivative d_rotation (Rows x 3) by the rotation vector of
// UnitQuaternion: right in every tangent direction of the quaternion, which is all that a solver
// asks for.
template <int Rows>
RowMajor<Rows, 4> ByQuaternion(const RowMajor<Rows, 3>& d_rotation, const double* q) {
  RowMajor<3, 4> minus;
  UnitQuaternion::MinusJacobian(q, minus.data());
  return d_rotation * minus;
}

}  // namespace holba
