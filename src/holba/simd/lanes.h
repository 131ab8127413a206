// SPDX-License-Identifier: BSD-3-Clause
// What a formula needs that is a template on its scalar: T is double, or a pack of doubles of
// pack.h. MaskOf<T> is the type of its comparisons; masks combine with & and |. Includes nothing
// that could reach a symbol table (targets.h).
//
// Formulas are HOLBA_SIMD_INLINE throughout, so that none of them exists outside its caller.
#pragma once

#define HOLBA_SIMD_INLINE inline __attribute__((always_inline))

namespace holba {

template <typename T>
struct Lanes;  // of packs: pack.h

template <>
struct Lanes<double> {
  using Mask = bool;
  static HOLBA_SIMD_INLINE double Sqrt(double x) { return __builtin_sqrt(x); }
  static HOLBA_SIMD_INLINE double Abs(double x) { return __builtin_fabs(x); }
  // 1 with the sign bit of x.
  static HOLBA_SIMD_INLINE double SignOf(double x) { return __builtin_copysign(1.0, x); }
  static HOLBA_SIMD_INLINE double Select(bool m, double a, double b) { return m ? a : b; }
  static HOLBA_SIMD_INLINE double Broadcast(double x) { return x; }
  static HOLBA_SIMD_INLINE bool Any(bool m) { return m; }
};

template <typename T>
using MaskOf = typename Lanes<T>::Mask;

// Where x is a number, not infinite.
template <typename T>
HOLBA_SIMD_INLINE MaskOf<T> IsFinite(T x) {
  return Lanes<T>::Abs(x) <= __DBL_MAX__;
}

template <typename T>
HOLBA_SIMD_INLINE MaskOf<T> AllTrue() {
  return T{} == T{};
}

template <typename T>
HOLBA_SIMD_INLINE MaskOf<T> NoneTrue() {
  return T{} != T{};
}

// Where a formula on doubles may end early; packs go on for their other lanes.
template <typename T>
HOLBA_SIMD_INLINE bool IsSingleFalse(MaskOf<T> m) {
  if constexpr (sizeof(T) == sizeof(double)) {
    return !m;
  } else {
    return false;
  }
}

}  // namespace holba
