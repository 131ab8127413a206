// SPDX-License-Identifier: BSD-3-Clause
// THIN_PRISM_FISHEYE: on the equidistant plane, radial k1..k4 in theta^2, tangential p1, p2 and
// thin prism (sx1, sy1) theta^2, all of the undistorted point. The cameras of ETH3D. Parameters [fx
// fy cx cy k1 k2 p1 p2 k3 k4 sx1 sy1], the first four in pixels.
#pragma once

#include <string_view>

#include "holba/camera/distortion.h"
#include "holba/camera/lens_camera.h"

namespace holba {

// Parameters [k1 k2 p1 p2 k3 k4 sx1 sy1].
struct ThinPrismDistortion {
  static constexpr int kNumParams = 8;

  static double RadialSlope(const double* k, double s) {
    const double radial[4] = {k[0], k[1], k[4], k[5]};
    return RadialPolynomialSlope<4>(radial, s);
  }

  template <typename T>
  static bool Distort(const T* k, const T& u, const T& v, T* ud, T* vd) {
    const T s = u * u + v * v;
    const T radial[4] = {k[0], k[1], k[4], k[5]};
    const T factor = 1.0 + RadialPolynomial<4>(radial, s);
    *ud = u * factor + k[6] * s;
    *vd = v * factor + k[7] * s;
    AddTangential(k[2], k[3], u, v, ud, vd);
    return true;
  }

  static bool DistortWithJacobian(const double* k, double u, double v, Distorted<8>* out) {
    const double s = u * u + v * v;
    const double radial[4] = {k[0], k[1], k[4], k[5]};
    SetRadial(u, v, 1.0 + RadialPolynomial<4>(radial, s), RadialPolynomialDerivative<4>(radial, s),
              out);
    AddTangential(k[2], k[3], 2, 3, u, v, out);
    out->u += k[6] * s;
    out->v += k[7] * s;
    out->d_uv[0] += 2.0 * k[6] * u;
    out->d_uv[1] += 2.0 * k[6] * v;
    out->d_uv[2] += 2.0 * k[7] * u;
    out->d_uv[3] += 2.0 * k[7] * v;
    constexpr int kRadial[4] = {0, 1, 4, 5};
    double power = s;
    for (int i = 0; i < 4; ++i, power *= s) out->SetParam(kRadial[i], u * power, v * power);
    out->SetParam(6, s, 0.0);
    out->SetParam(7, 0.0, s);
    return true;
  }
};

struct ThinPrismFisheye : FisheyeCamera<2, ThinPrismDistortion> {
  static constexpr int kModelId = 10;
  static constexpr std::string_view kName = "THIN_PRISM_FISHEYE";
  static constexpr std::string_view kParamNames = "fx fy cx cy k1 k2 p1 p2 k3 k4 sx1 sy1";
};

}  // namespace holba
