// SPDX-License-Identifier: BSD-3-Clause
// DIVISION (Fitzgibbon 2001): the undistorted point is the distorted one, at radius rho, divided by
// 1 + k rho^2. Forwards that is a quadratic, of which the root nearest to the centre is taken;
// where it has none (4 k r^2 >= 1) there is no image. Parameters [fx fy cx cy k], the first four in
// pixels.
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <optional>
#include <string_view>

#include "holba/camera/distortion.h"
#include "holba/camera/lens_camera.h"

namespace holba {

struct DivisionDistortion {
  static constexpr int kNumParams = 1;

  template <typename T>
  static bool Distort(const T* k, const T& u, const T& v, T* ud, T* vd) {
    using std::sqrt;
    const T discriminant = 1.0 - 4.0 * k[0] * (u * u + v * v);
    if (!(discriminant > T(0.0))) return false;
    const T factor = 2.0 / (1.0 + sqrt(discriminant));
    *ud = u * factor;
    *vd = v * factor;
    return true;
  }

  static bool DistortWithJacobian(const double* k, double u, double v, Distorted<1>* out) {
    const double s = u * u + v * v;
    const double discriminant = 1.0 - 4.0 * k[0] * s;
    if (!(discriminant > 0.0)) return false;
    const double root = std::sqrt(discriminant);
    const double factor = 2.0 / (1.0 + root);
    const double slope = factor * factor / root;
    SetRadial(u, v, factor, k[0] * slope, out);
    out->SetParam(0, u * s * slope, v * s * slope);
    return true;
  }

  // Beyond k rho^2 = 1 the point is the other root of the quadratic, below -1 its ray points
  // backwards.
  static std::optional<Eigen::Vector2d> Undistort(const double* k,
                                                  const Eigen::Vector2d& distorted) {
    const double t = k[0] * distorted.squaredNorm();
    if (!(std::abs(t) < 1.0)) return std::nullopt;
    return Eigen::Vector2d(distorted / (1.0 + t));
  }
};

struct Division : PerspectiveCamera<2, DivisionDistortion> {
  static constexpr int kModelId = 13;
  static constexpr std::string_view kName = "DIVISION";
  static constexpr std::string_view kParamNames = "fx fy cx cy k";
};

}  // namespace holba
