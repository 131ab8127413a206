// SPDX-License-Identifier: BSD-3-Clause
// FULL_OPENCV: on (u, v) = (x, y)/z, radial (1 + k1 r^2 + k2 r^4 + k3 r^6) / (1 + k4 r^2 + k5 r^4 +
// k6 r^6) and tangential p1, p2. Parameters [fx fy cx cy k1 k2 p1 p2 k3 k4 k5 k6], the first four
// in pixels.
#pragma once

#include <string_view>

#include "holba/camera/distortion.h"
#include "holba/camera/lens_camera.h"

namespace holba {

// Parameters [k1 k2 p1 p2 k3 k4 k5 k6].
struct RationalDistortion {
  static constexpr int kNumParams = 8;

  template <typename T>
  static HOLBA_SIMD_INLINE bool Distort(const T* k, const T& u, const T& v, T* ud, T* vd) {
    const T s = u * u + v * v;
    const T above[3] = {k[0], k[1], k[4]};
    const T factor = (1.0 + RadialPolynomial<3>(above, s)) / (1.0 + RadialPolynomial<3>(k + 5, s));
    *ud = u * factor;
    *vd = v * factor;
    AddTangential(k[2], k[3], u, v, ud, vd);
    return true;
  }

  template <typename T>
  static HOLBA_SIMD_INLINE MaskOf<T> DistortWithJacobian(const T* k, T u, T v,
                                                         Distorted<8, T>* out) {
    const T s = u * u + v * v;
    const T above[3] = {k[0], k[1], k[4]};
    const T* below = k + 5;
    const T inverse = 1.0 / (1.0 + RadialPolynomial<3>(below, s));
    const T factor = (1.0 + RadialPolynomial<3>(above, s)) * inverse;
    const T d_factor = (RadialPolynomialDerivative<3>(above, s) -
                        factor * RadialPolynomialDerivative<3>(below, s)) *
                       inverse;
    SetRadial(u, v, factor, d_factor, out);
    AddTangential(k[2], k[3], 2, 3, u, v, out);
    constexpr int kAbove[3] = {0, 1, 4};
    T power = s * inverse;
    for (int i = 0; i < 3; ++i, power *= s) {
      out->SetParam(kAbove[i], u * power, v * power);
      out->SetParam(5 + i, -factor * u * power, -factor * v * power);
    }
    return AllTrue<T>();
  }
};

struct FullOpenCV : PerspectiveCamera<2, RationalDistortion> {
  static constexpr int kModelId = 6;
  static constexpr std::string_view kName = "FULL_OPENCV";
  static constexpr std::string_view kParamNames = "fx fy cx cy k1 k2 p1 p2 k3 k4 k5 k6";
};

}  // namespace holba
