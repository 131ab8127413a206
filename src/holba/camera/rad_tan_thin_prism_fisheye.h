// SPDX-License-Identifier: BSD-3-Clause
// RAD_TAN_THIN_PRISM_FISHEYE (Fisheye624 of Project Aria): on the equidistant plane, first radial
// 1 + k0 theta^2 + ... + k5 theta^12; on the radially distorted (x, y), r^2 = x^2 + y^2, then
// tangential (2 p1 x y + p0 (r^2 + 2 x^2), 2 p0 x y + p1 (r^2 + 2 y^2)) and thin prism (s0 r^2 + s1
// r^4, s2 r^2 + s3 r^4). Parameters [fx fy cx cy k0 k1 k2 k3 k4 k5 p0 p1 s0 s1 s2 s3], the first
// four in pixels.
#pragma once

#include <string_view>

#include "holba/camera/distortion.h"
#include "holba/camera/lens_camera.h"

namespace holba {

struct RadTanThinPrismDistortion {
  static constexpr int kNumParams = 12;

  template <typename T>
  static bool Distort(const T* k, const T& u, const T& v, T* ud, T* vd) {
    T x, y;
    RadialDistortion<6>::Distort(k, u, v, &x, &y);
    const T s = x * x + y * y;
    *ud = x + s * (k[8] + k[9] * s);
    *vd = y + s * (k[10] + k[11] * s);
    AddTangential(k[7], k[6], x, y, ud, vd);
    return true;
  }

  static bool DistortWithJacobian(const double* k, double u, double v, Distorted<12>* out) {
    Distorted<6> radial;
    RadialDistortion<6>::DistortWithJacobian(k, u, v, &radial);
    const double x = radial.u, y = radial.v;
    const double s = x * x + y * y;
    SetRadial(x, y, 1.0, 0.0, out);
    AddTangential(k[7], k[6], 7, 6, x, y, out);
    const double prism_x = 2.0 * (k[8] + 2.0 * k[9] * s), prism_y = 2.0 * (k[10] + 2.0 * k[11] * s);
    out->u += s * (k[8] + k[9] * s);
    out->v += s * (k[10] + k[11] * s);
    // d(ud, vd)/d(x, y), then the chain rule through the radial stage.
    const double j00 = out->d_uv[0] + prism_x * x, j01 = out->d_uv[1] + prism_x * y;
    const double j10 = out->d_uv[2] + prism_y * x, j11 = out->d_uv[3] + prism_y * y;
    const double* r = radial.d_uv;
    out->d_uv[0] = j00 * r[0] + j01 * r[2];
    out->d_uv[1] = j00 * r[1] + j01 * r[3];
    out->d_uv[2] = j10 * r[0] + j11 * r[2];
    out->d_uv[3] = j10 * r[1] + j11 * r[3];
    for (int i = 0; i < 6; ++i) {
      const double dx = radial.d_k[i], dy = radial.d_k[6 + i];
      out->SetParam(i, j00 * dx + j01 * dy, j10 * dx + j11 * dy);
    }
    out->SetParam(8, s, 0.0);
    out->SetParam(9, s * s, 0.0);
    out->SetParam(10, 0.0, s);
    out->SetParam(11, 0.0, s * s);
    return true;
  }
};

struct RadTanThinPrismFisheye : FisheyeCamera<2, RadTanThinPrismDistortion> {
  static constexpr int kModelId = 11;
  static constexpr std::string_view kName = "RAD_TAN_THIN_PRISM_FISHEYE";
  static constexpr std::string_view kParamNames = "fx fy cx cy k0 k1 k2 k3 k4 k5 p0 p1 s0 s1 s2 s3";
};

}  // namespace holba
