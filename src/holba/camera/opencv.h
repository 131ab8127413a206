// SPDX-License-Identifier: BSD-3-Clause
// OPENCV: on (u, v) = (x, y)/z, radial 1 + k1 r^2 + k2 r^4 and tangential p1, p2 (Brown 1966).
// Parameters [fx fy cx cy k1 k2 p1 p2], the first four in pixels.
#pragma once

#include <string_view>

#include "holba/camera/distortion.h"
#include "holba/camera/lens_camera.h"

namespace holba {

// (u, v) (1 + k1 s + k2 s^2) + tangential(p1, p2).
struct BrownDistortion {
  static constexpr int kNumParams = 4;

  template <typename T>
  static HOLBA_SIMD_INLINE bool Distort(const T* k, const T& u, const T& v, T* ud, T* vd) {
    RadialDistortion<2>::Distort(k, u, v, ud, vd);
    AddTangential(k[2], k[3], u, v, ud, vd);
    return true;
  }

  template <typename T>
  static HOLBA_SIMD_INLINE MaskOf<T> DistortWithJacobian(const T* k, T u, T v,
                                                         Distorted<4, T>* out) {
    const T s = u * u + v * v;
    SetRadial(u, v, 1.0 + RadialPolynomial<2>(k, s), RadialPolynomialDerivative<2>(k, s), out);
    AddTangential(k[2], k[3], 2, 3, u, v, out);
    out->SetParam(0, u * s, v * s);
    out->SetParam(1, u * s * s, v * s * s);
    return AllTrue<T>();
  }
};

struct OpenCV : PerspectiveCamera<2, BrownDistortion> {
  static constexpr int kModelId = 4;
  static constexpr std::string_view kName = "OPENCV";
  static constexpr std::string_view kParamNames = "fx fy cx cy k1 k2 p1 p2";
};

}  // namespace holba
