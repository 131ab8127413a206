// SPDX-License-Identifier: BSD-3-Clause
// Every camera with one centre, a focal length and a principal point: the point (x, y, z) goes to
// the plane of the lens, is distorted there (distortion.h), and K = diag(fx, fy) + (cx, cy) makes
// it a pixel. Parameters: [f] or [fx fy], cx, cy (pixels), then those of the lens. Points with z <
// 2^-52 have no image, as in COLMAP; but a fisheye camera whose lens has RadialSlope sees beyond 90
// degrees from its axis, as far as the distance from the centre grows with the angle (MaxAngle).
// COLMAP 4.2 has no image there in these cameras, either, and no right ray for such a pixel.
#pragma once

#include "holba/camera/lens_formulas.h"

namespace holba {

// Where the lens acts. kNormalised: (x, y) / z. kEquidistant: the same direction at distance theta
// from the centre, theta the angle from the axis in radians (fisheye).
enum class LensPlane { kNormalised, kEquidistant };

template <int kNumFocals, LensPlane kPlane, typename Lens>
struct LensCamera;

template <int kNumFocals, typename Lens>
using PerspectiveCamera = LensCamera<kNumFocals, LensPlane::kNormalised, Lens>;
template <int kNumFocals, typename Lens>
using FisheyeCamera = LensCamera<kNumFocals, LensPlane::kEquidistant, Lens>;

}  // namespace holba

#ifdef HOLBA_SIMD_TARGET  // Such files know the formulas alone (simd/targets.h).

template <int kNumFocals, holba::LensPlane kPlane, typename Lens>
struct holba::LensCamera : LensFormulas<kNumFocals, Lens> {
  static_assert(kPlane == LensPlane::kNormalised);
};

#else

#include <Eigen/Core>
#include <array>
#include <cmath>
#include <optional>

#include "holba/camera/camera_model.h"
#include "holba/camera/distortion.h"
#include "holba/camera/undistortion.h"
#include "holba/geometry/dual.h"
#include "holba/geometry/types.h"

namespace holba {

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

// How far from the axis a lens on the equidistant plane sees, radians: to the angle, in whole
// degrees, at which its distance from the centre stops growing (beyond, two rays would share a
// pixel), and to 180 degrees, where the direction from the centre ends.
template <typename Lens>
double MaxLensAngle(const double* k) {
  constexpr double kDegree = M_PI / 180.0;
  if constexpr (Lens::kNumParams > 0) {
    for (int degrees = 1; degrees <= 180; ++degrees) {
      const double theta = degrees * kDegree;
      if (!(Lens::RadialSlope(k, theta * theta) > 0.0)) return (degrees - 1) * kDegree;
    }
  }
  return M_PI;
}

template <int kNumFocals, LensPlane kPlane, typename Lens>
struct LensCamera : LensFormulas<kNumFocals, Lens> {
  using Formulas = LensFormulas<kNumFocals, Lens>;
  using Formulas::kNumParams, Formulas::kFx, Formulas::kFy, Formulas::kCx, Formulas::kCy,
      Formulas::kLens;
  static_assert(kNumParams <= kMaxCameraParams);
  static constexpr auto kFocalIdxs = IndexRange<kNumFocals>(0);
  static constexpr auto kPrincipalPointIdxs = IndexRange<2>(kNumFocals);
  static constexpr auto kExtraIdxs = IndexRange<Lens::kNumParams>(kNumFocals + 2);
  static constexpr bool kSeesBeyond90Deg =
      kPlane == LensPlane::kEquidistant && requires(const double* k) { Lens::RadialSlope(k, 1.0); };
  static constexpr bool kIsPinhole = kPlane == LensPlane::kNormalised && Lens::kNumParams == 0;

  static IdealCalibration Calibration(const double* params) {
    return {params[kFx], params[kFy], params[kCx], params[kCy], kFx, kFy, kCx, kCy};
  }

  template <typename T>
  static bool Project(const T* params, const Vector3<T>& point_in_cam, Vector2<T>* pixel) {
    T u, v;
    if (!ToLensPlane(params, point_in_cam, &u, &v)) return false;
    T ud, vd;
    if (!Lens::Distort(params + kLens, u, v, &ud, &vd)) return false;
    pixel->x() = params[kFx] * ud + params[kCx];
    pixel->y() = params[kFy] * vd + params[kCy];
    return std::isfinite(ValueOf(pixel->x())) && std::isfinite(ValueOf(pixel->y()));
  }

  // d_point and d_params may be null: not wanted.
  static bool ProjectWithJacobian(const double* params, const Eigen::Vector3d& point_in_cam,
                                  Eigen::Vector2d* pixel, double* d_point, double* d_params) {
    if constexpr (kSeesBeyond90Deg) {
      if (IsWide(point_in_cam)) return ProjectWide(params, point_in_cam, pixel, d_point, d_params);
    }
    if (!(point_in_cam.z() >= kMinDepth)) return false;
    if constexpr (kPlane == LensPlane::kNormalised) {
      return Formulas::ProjectNormalised(params, point_in_cam.data(), pixel->data(), d_point,
                                         d_params);
    } else {
      const double inverse_z = 1.0 / point_in_cam.z();
      const double un = point_in_cam.x() * inverse_z, vn = point_in_cam.y() * inverse_z;
      const double s = un * un + vn * vn;
      const double ratio = AtanRatio(s);
      const double slope = 2.0 * AtanRatioDerivative(s, ratio);
      const double e00 = ratio + slope * un * un, e01 = slope * un * vn;
      const double e11 = ratio + slope * vn * vn;
      Distorted<Lens::kNumParams> at;
      if (!Lens::DistortWithJacobian(params + kLens, un * ratio, vn * ratio, &at)) return false;
      const double by_normalised[4] = {
          at.d_uv[0] * e00 + at.d_uv[1] * e01, at.d_uv[0] * e01 + at.d_uv[1] * e11,
          at.d_uv[2] * e00 + at.d_uv[3] * e01, at.d_uv[2] * e01 + at.d_uv[3] * e11};
      Formulas::ToPixel(params, inverse_z, un, vn, at, by_normalised, pixel->data(), d_point,
                        d_params);
      return std::isfinite(pixel->x()) && std::isfinite(pixel->y());
    }
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
      if (!(theta < M_PI)) return std::nullopt;
      const double z = std::cos(theta);
      if constexpr (kSeesBeyond90Deg) {
        if (z < kMinDepth && theta > MaxAngle(params)) return std::nullopt;
      } else {
        if (z < kMinDepth) return std::nullopt;
      }
      const double scale = theta > 1e-6 ? std::sin(theta) / theta : 1.0;
      return Eigen::Vector3d(scale * x->x(), scale * x->y(), z).normalized();
    }
  }

  static double MaxAngle(const double* params)
    requires(kSeesBeyond90Deg)
  {
    return MaxLensAngle<Lens>(params + kLens);
  }

 private:
  // Where the lens acts on the point. False: it has no image.
  template <typename T>
  static bool ToLensPlane(const T* params, const Vector3<T>& X, T* u, T* v) {
    if constexpr (kSeesBeyond90Deg) {
      if (IsWide(X)) {
        const T theta = WideAngle(params, X);
        if (theta == T(0.0)) return false;
        const T scale = theta / RadiusOf(X);
        *u = scale * X.x();
        *v = scale * X.y();
        return true;
      }
    }
    if (!(X.z() >= T(kMinDepth))) return false;
    const T inverse_z = 1.0 / X.z();
    *u = X.x() * inverse_z;
    *v = X.y() * inverse_z;
    if constexpr (kPlane == LensPlane::kEquidistant) {
      const T ratio = AtanRatio(T(*u * *u + *v * *v));
      *u *= ratio;
      *v *= ratio;
    }
    return true;
  }

  template <typename T>
  static T RadiusOf(const Vector3<T>& X) {
    using std::sqrt;
    return sqrt(X.x() * X.x() + X.y() * X.y());
  }

  // Whether a fisheye camera has to take the angle from (r, z): near 90 degrees from the axis,
  // where r / z says little, and beyond. The limit is 0.06 degrees before it.
  template <typename T>
  static bool IsWide(const Vector3<T>& X) {
    constexpr double kMinCotangent = 1e-3;
    const double x = ValueOf(X.x()), y = ValueOf(X.y()), z = ValueOf(X.z());
    return z < kMinDepth || z * z < kMinCotangent * kMinCotangent * (x * x + y * y);
  }

  // The angle from the axis of a point that IsWide, radians; 0: it has no image.
  template <typename T>
  static T WideAngle(const T* params, const Vector3<T>& X) {
    using std::atan2;
    const double r = std::hypot(ValueOf(X.x()), ValueOf(X.y())), z = ValueOf(X.z());
    // At 180 degrees the direction from the centre is rounding; so is all at the camera's centre.
    if (!(r >= kMinDepth * std::abs(z)) || !(r + std::abs(z) >= kMinDepth)) return T(0.0);
    if (z < kMinDepth) {
      double k[Lens::kNumParams + 1];
      for (int i = 0; i < Lens::kNumParams; ++i) k[i] = ValueOf(params[kLens + i]);
      if (std::atan2(r, z) > MaxLensAngle<Lens>(k)) return T(0.0);
    }
    return atan2(RadiusOf(X), X.z());
  }

  // ProjectWithJacobian of a point that IsWide.
  static bool ProjectWide(const double* params, const Eigen::Vector3d& X, Eigen::Vector2d* pixel,
                          double* d_point, double* d_params) {
    const double theta = WideAngle(params, X);
    if (theta == 0.0) return false;
    const double r = RadiusOf(X), squared = X.squaredNorm();
    const double scale = theta / r;
    Distorted<Lens::kNumParams> at;
    if (!Lens::DistortWithJacobian(params + kLens, scale * X.x(), scale * X.y(), &at)) return false;
    Formulas::ToPixel(params, 1.0, 0.0, 0.0, at, at.d_uv, pixel->data(),
                      static_cast<double*>(nullptr), d_params);
    if (d_point != nullptr) {
      // d(u, v)/d(x, y, z); d(theta) = (z dr - r dz) / |X|^2.
      const double slope = (X.z() / squared - scale) / (r * r);
      RowMajor<2, 3> by_point;
      by_point << scale + slope * X.x() * X.x(), slope * X.x() * X.y(), -X.x() / squared,
          slope * X.x() * X.y(), scale + slope * X.y() * X.y(), -X.y() / squared;
      Eigen::Map<RowMajor<2, 3>> J(d_point);
      J = Eigen::Map<const RowMajor<2, 2>>(at.d_uv) * by_point;
      J.row(0) *= params[kFx];
      J.row(1) *= params[kFy];
    }
    return std::isfinite(pixel->x()) && std::isfinite(pixel->y());
  }
};

}  // namespace holba

#endif  // HOLBA_SIMD_TARGET
