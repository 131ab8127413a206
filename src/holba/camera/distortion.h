// SPDX-License-Identifier: BSD-3-Clause
// Pieces that lenses are made of. A lens maps a point (u, v) of a plane to its distorted place:
//   static constexpr int kNumParams;
//   // False: the point has no image.
//   template <typename T>
//   static bool Distort(const T* k, const T& u, const T& v, T* ud, T* vd);
//   // The same with derivatives, written by hand. Of the cameras in vectorised_models.h a template
//   // on the scalar, which is also a pack (simd/pack.h), otherwise bool on double:
//   template <typename T>
//   static MaskOf<T> DistortWithJacobian(const T* k, T u, T v, Distorted<kNumParams, T>* out);
//   // Optional, where a closed form exists (otherwise undistortion.h inverts it): the inverse.
//   static std::optional<Eigen::Vector2d> Undistort(const double* k, const Eigen::Vector2d&
//   distorted);
//   // Optional, of lenses on the equidistant plane that see beyond 90 degrees: d(distance from the
//   centre) / d(theta) of the radial part,
//   // s = theta^2.
//   static double RadialSlope(const double* k, double s);
// The plane is the normalised one (x/z, y/z) or the equidistant one (lens_camera.h). Lengths are in
// focal lengths; formulas are COLMAP's.
#pragma once

#include "holba/simd/lanes.h"

namespace holba {

// A distorted point with d(ud, vd)/d(u, v), row-major 2 x 2, and d(ud, vd)/d(k), row-major 2 x N.
template <int N, typename T = double>
struct Distorted {
  T u, v;
  T d_uv[4];
  T d_k[N > 0 ? 2 * N : 1];

  // Column i of d_k.
  HOLBA_SIMD_INLINE void SetParam(int i, T du, T dv) {
    d_k[i] = du;
    d_k[N + i] = dv;
  }
};

// Sum over i = 1..N of k[(i - 1)] s^i, without the constant 1.
template <int N, typename T>
HOLBA_SIMD_INLINE T RadialPolynomial(const T* k, const T& s) {
  T sum{};
  for (int i = N - 1; i >= 0; --i) sum = (sum + k[i]) * s;
  return sum;
}

// Its derivative by s.
template <int N, typename T>
HOLBA_SIMD_INLINE T RadialPolynomialDerivative(const T* k, const T& s) {
  T sum{};
  for (int i = N - 1; i >= 0; --i) sum = sum * s + static_cast<double>(i + 1) * k[i];
  return sum;
}

// d(t (1 + k[0] s + ... + k[N - 1] s^N)) / dt, s = t^2.
template <int N>
double RadialPolynomialSlope(const double* k, double s) {
  return 1.0 + RadialPolynomial<N>(k, s) + 2.0 * s * RadialPolynomialDerivative<N>(k, s);
}

// (u, v) * factor(s), s = u^2 + v^2, d_factor = factor'(s).
template <int N, typename T>
HOLBA_SIMD_INLINE void SetRadial(T u, T v, T factor, T d_factor, Distorted<N, T>* out) {
  const T cross = 2.0 * d_factor * u * v;
  out->u = factor * u;
  out->v = factor * v;
  out->d_uv[0] = factor + 2.0 * d_factor * u * u;
  out->d_uv[1] = cross;
  out->d_uv[2] = cross;
  out->d_uv[3] = factor + 2.0 * d_factor * v * v;
}

// Decentring (Brown 1966): + (2 a u v + b (s + 2 u^2), 2 b u v + a (s + 2 v^2)), s = u^2 + v^2.
template <typename T>
HOLBA_SIMD_INLINE void AddTangential(const T& a, const T& b, const T& u, const T& v, T* ud, T* vd) {
  const T uu = u * u, vv = v * v, uv2 = 2.0 * u * v;
  *ud += a * uv2 + b * (3.0 * uu + vv);
  *vd += b * uv2 + a * (uu + 3.0 * vv);
}

// The same on a point with derivatives; a_idx, b_idx: the places of a and b among the parameters.
template <int N, typename T>
HOLBA_SIMD_INLINE void AddTangential(T a, T b, int a_idx, int b_idx, T u, T v,
                                     Distorted<N, T>* out) {
  const T uu = u * u, vv = v * v, uv2 = 2.0 * u * v;
  const T along_u = 3.0 * uu + vv, along_v = uu + 3.0 * vv;
  const T cross = 2.0 * (a * u + b * v);
  out->u += a * uv2 + b * along_u;
  out->v += b * uv2 + a * along_v;
  out->d_uv[0] += 2.0 * a * v + 6.0 * b * u;
  out->d_uv[1] += cross;
  out->d_uv[2] += cross;
  out->d_uv[3] += 2.0 * b * u + 6.0 * a * v;
  out->SetParam(a_idx, uv2, along_v);
  out->SetParam(b_idx, along_u, uv2);
}

// (u, v) (1 + k1 s + ... + kN s^N). N = 0: no distortion.
template <int N>
struct RadialDistortion {
  static constexpr int kNumParams = N;

  static double RadialSlope(const double* k, double s) { return RadialPolynomialSlope<N>(k, s); }

  template <typename T>
  static HOLBA_SIMD_INLINE bool Distort(const T* k, const T& u, const T& v, T* ud, T* vd) {
    if constexpr (N == 0) {
      *ud = u;
      *vd = v;
    } else {
      const T factor = 1.0 + RadialPolynomial<N>(k, T(u * u + v * v));
      *ud = u * factor;
      *vd = v * factor;
    }
    return true;
  }

  template <typename T>
  static HOLBA_SIMD_INLINE MaskOf<T> DistortWithJacobian(const T* k, T u, T v,
                                                         Distorted<N, T>* out) {
    const T s = u * u + v * v;
    SetRadial(u, v, 1.0 + RadialPolynomial<N>(k, s), RadialPolynomialDerivative<N>(k, s), out);
    T power = s;
    for (int i = 0; i < N; ++i, power *= s) out->SetParam(i, u * power, v * power);
    return AllTrue<T>();
  }
};

using NoDistortion = RadialDistortion<0>;

}  // namespace holba
