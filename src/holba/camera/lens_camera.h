// SPDX-License-Identifier: BSD-3-Clause
// Every camera with one centre, a focal length and a principal point: the point (x, y, z) goes to
// the plane of the lens, is distorted there (distortion.h), and K = diag(fx, fy) + (cx, cy) makes
// it a pixel. Parameters: [f] or [fx fy], cx, cy (pixels), then those of the lens. Points with z <
// 2^-52 have no image, as in COLMAP, in fisheye cameras too; so a pixel whose ray would be at 90
// degrees or more has no ray.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cmath>
#include <limits>
#include <optional>

#include "holba/camera/camera_model.h"
#include "holba/camera/distortion.h"
#include "holba/camera/undistortion.h"
#include "holba/geometry/dual.h"
#include "holba/geometry/types.h"

namespace holba {

// Where the lens acts. kNormalised: (x, y) / z. kEquidistant: the same direction at distance theta
// from the centre, theta the angle from the axis in radians (fisheye).
enum class LensPlane { kNormalised, kEquidistant };

inline constexpr double kMinDepth = std::numeric_limits<double>::epsilon();

// first, first + 1, ...
template <int N>
constexpr std::array<int, N> IndexRange(int first) {
  std::array<int, N> range{};
  for (int i = 0; i < N; ++i) range[i] = first + i;
  return range;
}

// atan(r) / r as a function of s = r^2, smooth at 0.
template <typename T>
T AtanRatio(const T& s) {
  using std::atan;
  using std::sqrt;
  if (s < T(1e-2)) {
    T sum(0.0);
    for (int i = 8; i >= 0; --i) sum = 1.0 / (2 * i + 1) - s * sum;
    return sum;
  }
  const T r = sqrt(s);
  return atan(r) / r;
}

// Its derivative by s; ratio = AtanRatio(s).
inline double AtanRatioDerivative(double s, double ratio) {
  if (s < 1e-2) {
    double sum = 0.0;
    for (int i = 9; i >= 1; --i) sum = -static_cast<double>(i) / (2 * i + 1) - s * sum;
    return sum;
  }
  return (1.0 / (1.0 + s) - ratio) / (2.0 * s);
}

template <int kNumFocals, LensPlane kPlane, typename Lens>
struct LensCamera {
  static_assert(kNumFocals == 1 || kNumFocals == 2);
  static constexpr int kNumParams = kNumFocals + 2 + Lens::kNumParams;
  static_assert(kNumParams <= kMaxCameraParams);
  static constexpr auto kFocalIdxs = IndexRange<kNumFocals>(0);
  static constexpr auto kPrincipalPointIdxs = IndexRange<2>(kNumFocals);
  static constexpr auto kExtraIdxs = IndexRange<Lens::kNumParams>(kNumFocals + 2);
  static constexpr bool kIsPinhole = kPlane == LensPlane::kNormalised && Lens::kNumParams == 0;

  static constexpr int kFx = 0, kFy = kNumFocals - 1, kCx = kNumFocals, kCy = kNumFocals + 1;
  static constexpr int kLens = kNumFocals + 2;

  static IdealCalibration Calibration(const double* params) {
    return {params[kFx], params[kFy], params[kCx], params[kCy], kFx, kFy, kCx, kCy};
  }

  template <typename T>
  static bool Project(const T* params, const Vector3<T>& point_in_cam, Vector2<T>* pixel) {
    if (!(point_in_cam.z() >= T(kMinDepth))) return false;
    const T inverse_z = 1.0 / point_in_cam.z();
    T u = point_in_cam.x() * inverse_z, v = point_in_cam.y() * inverse_z;
    if constexpr (kPlane == LensPlane::kEquidistant) {
      const T ratio = AtanRatio(T(u * u + v * v));
      u *= ratio;
      v *= ratio;
    }
    T ud, vd;
    if (!Lens::Distort(params + kLens, u, v, &ud, &vd)) return false;
    pixel->x() = params[kFx] * ud + params[kCx];
    pixel->y() = params[kFy] * vd + params[kCy];
    return std::isfinite(ValueOf(pixel->x())) && std::isfinite(ValueOf(pixel->y()));
  }

  // d_point and d_params may be null: not wanted.
  static bool ProjectWithJacobian(const double* params, const Eigen::Vector3d& point_in_cam,
                                  Eigen::Vector2d* pixel, double* d_point, double* d_params) {
    if (!(point_in_cam.z() >= kMinDepth)) return false;
    const double inverse_z = 1.0 / point_in_cam.z();
    const double un = point_in_cam.x() * inverse_z, vn = point_in_cam.y() * inverse_z;
    const double fx = params[kFx], fy = params[kFy];
    // d(distorted)/d(normalised).
    double j00, j01, j10, j11;
    Distorted<Lens::kNumParams> at;
    if constexpr (kIsPinhole) {
      at.u = un;
      at.v = vn;
      j00 = j11 = 1.0;
      j01 = j10 = 0.0;
    } else if constexpr (kPlane == LensPlane::kNormalised) {
      if (!Lens::DistortWithJacobian(params + kLens, un, vn, &at)) return false;
      j00 = at.d_uv[0], j01 = at.d_uv[1], j10 = at.d_uv[2], j11 = at.d_uv[3];
    } else {
      const double s = un * un + vn * vn;
      const double ratio = AtanRatio(s);
      const double slope = 2.0 * AtanRatioDerivative(s, ratio);
      const double e00 = ratio + slope * un * un, e01 = slope * un * vn;
      const double e11 = ratio + slope * vn * vn;
      if (!Lens::DistortWithJacobian(params + kLens, un * ratio, vn * ratio, &at)) return false;
      j00 = at.d_uv[0] * e00 + at.d_uv[1] * e01;
      j01 = at.d_uv[0] * e01 + at.d_uv[1] * e11;
      j10 = at.d_uv[2] * e00 + at.d_uv[3] * e01;
      j11 = at.d_uv[2] * e01 + at.d_uv[3] * e11;
    }
    pixel->x() = fx * at.u + params[kCx];
    pixel->y() = fy * at.v + params[kCy];
    if (!std::isfinite(pixel->x()) || !std::isfinite(pixel->y())) return false;
    if (d_point != nullptr) {
      const double gx = fx * inverse_z, gy = fy * inverse_z;
      if constexpr (kIsPinhole) {
        d_point[0] = gx;
        d_point[1] = 0.0;
        d_point[2] = -gx * un;
        d_point[3] = 0.0;
        d_point[4] = gy;
        d_point[5] = -gy * vn;
      } else {
        d_point[0] = gx * j00;
        d_point[1] = gx * j01;
        d_point[2] = -gx * (j00 * un + j01 * vn);
        d_point[3] = gy * j10;
        d_point[4] = gy * j11;
        d_point[5] = -gy * (j10 * un + j11 * vn);
      }
    }
    if (d_params != nullptr) {
      double *row_x = d_params, *row_y = d_params + kNumParams;
      if constexpr (kNumFocals == 2) row_x[kFy] = row_y[kFx] = 0.0;
      row_x[kFx] = at.u;
      row_y[kFy] = at.v;
      row_x[kCx] = row_y[kCy] = 1.0;
      row_x[kCy] = row_y[kCx] = 0.0;
      for (int i = 0; i < Lens::kNumParams; ++i) {
        row_x[kLens + i] = fx * at.d_k[i];
        row_y[kLens + i] = fy * at.d_k[Lens::kNumParams + i];
      }
    }
    return true;
  }

  static std::optional<Eigen::Vector3d> Unproject(const double* params,
                                                  const Eigen::Vector2d& pixel) {
    const Eigen::Vector2d distorted((pixel.x() - params[kCx]) / params[kFx],
                                    (pixel.y() - params[kCy]) / params[kFy]);
    const std::optional<Eigen::Vector2d> x = Undistort<Lens>(params + kLens, distorted);
    if (!x) return std::nullopt;
    if constexpr (kPlane == LensPlane::kNormalised) {
      return Eigen::Vector3d(x->x(), x->y(), 1.0).normalized();
    } else {
      const double theta = x->norm();
      const double z = std::cos(theta);
      if (!(theta < 2.0) || z < kMinDepth) return std::nullopt;
      const double scale = theta > 1e-6 ? std::sin(theta) / theta : 1.0;
      return Eigen::Vector3d(scale * x->x(), scale * x->y(), z).normalized();
    }
  }
};

template <int kNumFocals, typename Lens>
using PerspectiveCamera = LensCamera<kNumFocals, LensPlane::kNormalised, Lens>;
template <int kNumFocals, typename Lens>
using FisheyeCamera = LensCamera<kNumFocals, LensPlane::kEquidistant, Lens>;

}  // namespace holba
