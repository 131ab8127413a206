// SPDX-License-Identifier: BSD-3-Clause
// FOV (Devernay and Faugeras 2001): the radius r of (x, y)/z becomes atan(2 r tan(omega/2)) /
// omega. Parameters [fx fy cx cy omega], the first four in pixels, omega in radians, |omega| < pi;
// omega = 0 is the pinhole. COLMAP replaces the formula by truncated series for omega^2 < 1e-4 and
// for r^2 < 1e-4, the first with a wrong sign; here it is the exact formula everywhere.
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <numbers>
#include <optional>
#include <string_view>

#include "holba/camera/distortion.h"
#include "holba/camera/lens_camera.h"

namespace holba {

struct FovDistortion {
  static constexpr int kNumParams = 1;

  // 2 tan(omega/2) / omega, smooth at 0.
  template <typename T>
  static T TanRatio(const T& omega) {
    using std::abs;
    using std::tan;
    if (abs(omega) < T(0.05)) {
      const T s = 0.25 * omega * omega;
      return 1.0 + s * (1.0 / 3 + s * (2.0 / 15 + s * (17.0 / 315 + s * (62.0 / 2835))));
    }
    return 2.0 * tan(T(0.5 * omega)) / omega;
  }

  // Its derivative by omega; ratio = TanRatio(omega).
  static double TanRatioDerivative(double omega, double ratio) {
    if (std::abs(omega) < 0.05) {
      const double s = 0.25 * omega * omega;
      return 0.5 * omega * (1.0 / 3 + s * (4.0 / 15 + s * (17.0 / 105 + s * (248.0 / 2835))));
    }
    const double c = ratio * omega;
    return (1.0 + 0.25 * c * c - ratio) / omega;
  }

  template <typename T>
  static bool Distort(const T* k, const T& u, const T& v, T* ud, T* vd) {
    const T ratio = TanRatio(k[0]);
    const T c = ratio * k[0];
    const T factor = ratio * AtanRatio(T(c * c * (u * u + v * v)));
    *ud = u * factor;
    *vd = v * factor;
    return true;
  }

  static bool DistortWithJacobian(const double* k, double u, double v, Distorted<1>* out) {
    const double s = u * u + v * v;
    const double ratio = TanRatio(k[0]);
    const double c = ratio * k[0];
    const double d_c = 1.0 + 0.25 * c * c;
    const double atan_ratio = AtanRatio(c * c * s);
    const double d_atan_ratio = AtanRatioDerivative(c * c * s, atan_ratio);
    SetRadial(u, v, ratio * atan_ratio, ratio * d_atan_ratio * c * c, out);
    const double d_omega =
        TanRatioDerivative(k[0], ratio) * atan_ratio + ratio * d_atan_ratio * 2.0 * c * d_c * s;
    out->SetParam(0, u * d_omega, v * d_omega);
    return true;
  }

  static std::optional<Eigen::Vector2d> Undistort(const double* k,
                                                  const Eigen::Vector2d& distorted) {
    const double angle = distorted.norm() * std::abs(k[0]);
    if (!(angle < std::numbers::pi / 2)) return std::nullopt;
    const double ratio = angle > 1e-4 ? std::tan(angle) / angle : 1.0 + angle * angle / 3.0;
    return Eigen::Vector2d(distorted * (ratio / TanRatio(k[0])));
  }
};

struct Fov : PerspectiveCamera<2, FovDistortion> {
  static constexpr int kModelId = 7;
  static constexpr std::string_view kName = "FOV";
  static constexpr std::string_view kParamNames = "fx fy cx cy omega";
};

}  // namespace holba
