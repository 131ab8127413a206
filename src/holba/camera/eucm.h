// SPDX-License-Identifier: BSD-3-Clause
// EUCM, the enhanced unified camera model (Khomutenko, Garcia and Martinet 2016): (x, y) divided by
// alpha sqrt(beta (x^2 + y^2) + z^2) + (1 - alpha) z. Parameters [fx fy cx cy alpha beta], the
// first four in pixels, alpha in [0, 1], beta > 0; alpha = 0 is the pinhole.
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <optional>
#include <string_view>

#include "holba/camera/distortion.h"
#include "holba/camera/lens_camera.h"

namespace holba {

// On the normalised plane, z = 1.
struct EucmDistortion {
  static constexpr int kNumParams = 2;

  template <typename T>
  static bool Distort(const T* k, const T& u, const T& v, T* ud, T* vd) {
    using std::sqrt;
    const T rho_squared = k[1] * (u * u + v * v) + 1.0;
    if (!(rho_squared > T(0.0))) return false;
    const T denominator = k[0] * sqrt(rho_squared) + (1.0 - k[0]);
    if (!(denominator >= T(kMinDepth))) return false;
    *ud = u / denominator;
    *vd = v / denominator;
    return true;
  }

  static bool DistortWithJacobian(const double* k, double u, double v, Distorted<2>* out) {
    const double alpha = k[0], beta = k[1];
    const double s = u * u + v * v;
    const double rho_squared = beta * s + 1.0;
    if (!(rho_squared > 0.0)) return false;
    const double rho = std::sqrt(rho_squared);
    const double denominator = alpha * rho + (1.0 - alpha);
    if (!(denominator >= kMinDepth)) return false;
    const double factor = 1.0 / denominator;
    const double slope = -factor * factor;  // d(factor)/d(denominator)
    SetRadial(u, v, factor, slope * 0.5 * alpha * beta / rho, out);
    out->SetParam(0, u * slope * (rho - 1.0), v * slope * (rho - 1.0));
    out->SetParam(1, u * slope * 0.5 * alpha * s / rho, v * slope * 0.5 * alpha * s / rho);
    return true;
  }

  static std::optional<Eigen::Vector2d> Undistort(const double* k,
                                                  const Eigen::Vector2d& distorted) {
    const double alpha = k[0], beta = k[1];
    const double s = distorted.squaredNorm();
    const double radicand = 1.0 - (2.0 * alpha - 1.0) * beta * s;
    if (!(radicand >= 0.0)) return std::nullopt;
    const double denominator = alpha * std::sqrt(radicand) + (1.0 - alpha);
    const double depth = (1.0 - alpha * alpha * beta * s) / denominator;
    if (!(denominator >= kMinDepth) || !(depth >= kMinDepth)) return std::nullopt;
    return Eigen::Vector2d(distorted / depth);
  }
};

struct Eucm : PerspectiveCamera<2, EucmDistortion> {
  static constexpr int kModelId = 16;
  static constexpr std::string_view kName = "EUCM";
  static constexpr std::string_view kParamNames = "fx fy cx cy alpha beta";
};

}  // namespace holba
