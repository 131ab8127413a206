// SPDX-License-Identifier: BSD-3-Clause
// Formulas of cameras with one centre (lens_camera.h) as templates on the scalar: T is double, or a
// pack (simd/pack.h) in files that are compiled for wide registers. Parameters: [f] or [fx fy], cx,
// cy (pixels), then those of the lens.
#pragma once

#include "holba/camera/distortion.h"
#include "holba/simd/lanes.h"

namespace holba {

inline constexpr double kMinDepth = __DBL_EPSILON__;

template <int kNumFocals, typename Lens>
struct LensFormulas {
  static_assert(kNumFocals == 1 || kNumFocals == 2);
  static constexpr int kNumParams = kNumFocals + 2 + Lens::kNumParams;
  static constexpr int kFx = 0, kFy = kNumFocals - 1, kCx = kNumFocals, kCy = kNumFocals + 1;
  static constexpr int kLens = kNumFocals + 2;

  // Pixel of what the lens made of (un, vn) = (x, y) / z, and its derivatives by the point (2 x 3)
  // and the parameters (2 x kNumParams), row-major; null: not wanted. by_normalised: d(at)/d(un,
  // vn), 2 x 2.
  template <typename T>
  static HOLBA_SIMD_INLINE void ToPixel(const T* params, T inverse_z, T un, T vn,
                                        const Distorted<Lens::kNumParams, T>& at,
                                        const T* by_normalised, T* pixel, T* d_point, T* d_params) {
    const T fx = params[kFx], fy = params[kFy];
    pixel[0] = fx * at.u + params[kCx];
    pixel[1] = fy * at.v + params[kCy];
    if (d_point != nullptr) {
      const T gx = fx * inverse_z, gy = fy * inverse_z;
      const T* j = by_normalised;
      d_point[0] = gx * j[0];
      d_point[1] = gx * j[1];
      d_point[2] = -gx * (j[0] * un + j[1] * vn);
      d_point[3] = gy * j[2];
      d_point[4] = gy * j[3];
      d_point[5] = -gy * (j[2] * un + j[3] * vn);
    }
    if (d_params != nullptr) {
      T *row_x = d_params, *row_y = d_params + kNumParams;
      const T zero{}, one = 1.0 + zero;
      if constexpr (kNumFocals == 2) row_x[kFy] = row_y[kFx] = zero;
      row_x[kFx] = at.u;
      row_y[kFy] = at.v;
      row_x[kCx] = row_y[kCy] = one;
      row_x[kCy] = row_y[kCx] = zero;
      for (int i = 0; i < Lens::kNumParams; ++i) {
        row_x[kLens + i] = fx * at.d_k[i];
        row_y[kLens + i] = fy * at.d_k[Lens::kNumParams + i];
      }
    }
  }

  // Of a camera whose lens acts on the normalised plane: the pixel of a point, with derivatives
  // where wanted. False: no image; what is written then is of no use.
  template <typename T>
  static HOLBA_SIMD_INLINE MaskOf<T> ProjectNormalised(const T* params, const T* point_in_cam,
                                                       T* pixel, T* d_point, T* d_params) {
    MaskOf<T> seen = point_in_cam[2] >= kMinDepth;
    if (IsSingleFalse<T>(seen)) return seen;
    const T inverse_z = 1.0 / point_in_cam[2];
    const T un = point_in_cam[0] * inverse_z, vn = point_in_cam[1] * inverse_z;
    if (d_point == nullptr && d_params == nullptr) {
      T ud, vd;
      // Lenses that can fail are not vectorised: they fail as a whole.
      if (!Lens::Distort(params + kLens, un, vn, &ud, &vd)) return NoneTrue<T>();
      pixel[0] = params[kFx] * ud + params[kCx];
      pixel[1] = params[kFy] * vd + params[kCy];
    } else {
      Distorted<Lens::kNumParams, T> at;
      if constexpr (Lens::kNumParams == 0) {
        // The derivatives written out, so that zeros stay zeros.
        const T zero{}, one = 1.0 + zero;
        at.u = un;
        at.v = vn;
        const T identity[4] = {one, zero, zero, one};
        ToPixel(params, inverse_z, un, vn, at, identity, pixel, static_cast<T*>(nullptr), d_params);
        if (d_point != nullptr) {
          const T gx = params[kFx] * inverse_z, gy = params[kFy] * inverse_z;
          d_point[0] = gx;
          d_point[1] = zero;
          d_point[2] = -gx * un;
          d_point[3] = zero;
          d_point[4] = gy;
          d_point[5] = -gy * vn;
        }
      } else {
        seen = seen & Lens::DistortWithJacobian(params + kLens, un, vn, &at);
        if (IsSingleFalse<T>(seen)) return seen;
        ToPixel(params, inverse_z, un, vn, at, at.d_uv, pixel, d_point, d_params);
      }
    }
    return seen & IsFinite(pixel[0]) & IsFinite(pixel[1]);
  }
};

}  // namespace holba
