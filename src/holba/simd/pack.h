// SPDX-License-Identifier: BSD-3-Clause
// Pack: as many doubles as the target's registers hold, with + - * / and comparisons lane by lane
// (the vector extension of GCC and Clang). A comparison gives a Mask; mask ? a : b chooses lane by
// lane; masks combine with & | ~. At the target `scalar` a Pack is a double and a Mask a bool, so
// the same template compiles for both. Only for X_simd.cc files (targets.h).
#pragma once

#include <cstddef>
#include <cstdint>

#if defined(__x86_64__)
#include <immintrin.h>
#endif

#include "holba/simd/lanes.h"

#ifndef HOLBA_SIMD_TARGET
#error "pack.h belongs to files X_simd.cc, which are compiled once for each target"
#endif

namespace holba::HOLBA_SIMD_TARGET {

#if defined(HOLBA_SIMD_SCALAR)
inline constexpr int kLanes = 1;
using Pack = double;
using Mask = bool;
using Int = int64_t;  // of as many lanes

HOLBA_SIMD_INLINE Pack Load(const double* p) { return *p; }
HOLBA_SIMD_INLINE void Store(Pack x, double* p) { *p = x; }
HOLBA_SIMD_INLINE double Lane(Pack x, int) { return x; }
HOLBA_SIMD_INLINE Pack Sqrt(Pack x) { return __builtin_sqrt(x); }
HOLBA_SIMD_INLINE Int Bits(Pack x) { return __builtin_bit_cast(Int, x); }
HOLBA_SIMD_INLINE Pack FromBits(Int x) { return __builtin_bit_cast(Pack, x); }
HOLBA_SIMD_INLINE Pack Abs(Pack x) { return __builtin_fabs(x); }
HOLBA_SIMD_INLINE Pack SignOf(Pack x) { return __builtin_copysign(1.0, x); }
HOLBA_SIMD_INLINE double Sum(Pack x) { return x; }
HOLBA_SIMD_INLINE bool Any(Mask m) { return m; }
HOLBA_SIMD_INLINE bool All(Mask m) { return m; }
HOLBA_SIMD_INLINE Mask Not(Mask m) { return !m; }
HOLBA_SIMD_INLINE bool MaskLane(Mask m, int) { return m; }
#else
inline constexpr int kLanes = HOLBA_SIMD_BYTES / 8;
using Pack = double __attribute__((vector_size(HOLBA_SIMD_BYTES)));
using Mask = int64_t __attribute__((vector_size(HOLBA_SIMD_BYTES)));
using Int = Mask;
namespace internal {
using UnalignedPack = double __attribute__((vector_size(HOLBA_SIMD_BYTES), aligned(8), may_alias));
}  // namespace internal

// From and to addresses of any alignment (aligned ones are as fast as can be).
HOLBA_SIMD_INLINE Pack Load(const double* p) {
  return *reinterpret_cast<const internal::UnalignedPack*>(p);
}
HOLBA_SIMD_INLINE void Store(Pack x, double* p) {
  *reinterpret_cast<internal::UnalignedPack*>(p) = x;
}
HOLBA_SIMD_INLINE double Lane(Pack x, int lane) { return x[lane]; }
HOLBA_SIMD_INLINE Pack Sqrt(Pack x) {
#if defined(__AVX512F__)
  return _mm512_maskz_sqrt_pd(0xff, x);
#elif defined(__AVX__)
  return _mm256_sqrt_pd(x);
#elif defined(__x86_64__)
  return _mm_sqrt_pd(x);
#else
  for (int i = 0; i < kLanes; ++i) x[i] = __builtin_sqrt(x[i]);
  return x;
#endif
}
// Bits of a pack as integers, and back.
HOLBA_SIMD_INLINE Int Bits(Pack x) { return reinterpret_cast<Int>(x); }
HOLBA_SIMD_INLINE Pack FromBits(Int x) { return reinterpret_cast<Pack>(x); }
HOLBA_SIMD_INLINE Pack Abs(Pack x) { return FromBits(Bits(x) & INT64_MAX); }
// 1 with the sign bit of x.
HOLBA_SIMD_INLINE Pack SignOf(Pack x) {
  return FromBits((Bits(x) & INT64_MIN) | Bits(1.0 - Pack{}));
}
HOLBA_SIMD_INLINE double Sum(Pack x) {
  double sum = x[0];
  for (int i = 1; i < kLanes; ++i) sum += x[i];
  return sum;
}
HOLBA_SIMD_INLINE bool Any(Mask m) {
#if defined(__AVX512DQ__)
  return _mm512_movepi64_mask(reinterpret_cast<__m512i>(m)) != 0;
#elif defined(__AVX2__)
  return _mm256_movemask_pd(reinterpret_cast<__m256d>(m)) != 0;
#else
  int64_t any = 0;
  for (int i = 0; i < kLanes; ++i) any |= m[i];
  return any != 0;
#endif
}
HOLBA_SIMD_INLINE bool All(Mask m) {
#if defined(__AVX512DQ__)
  return _mm512_movepi64_mask(reinterpret_cast<__m512i>(m)) == 0xff;
#elif defined(__AVX2__)
  return _mm256_movemask_pd(reinterpret_cast<__m256d>(m)) == 0xf;
#else
  int64_t all = -1;
  for (int i = 0; i < kLanes; ++i) all &= m[i];
  return all != 0;
#endif
}
HOLBA_SIMD_INLINE Mask Not(Mask m) { return ~m; }
HOLBA_SIMD_INLINE bool MaskLane(Mask m, int lane) { return m[lane] != 0; }
#endif

HOLBA_SIMD_INLINE Pack Broadcast(double x) { return x - Pack{}; }

// a * b + c, rounded once where the target has such an instruction.
HOLBA_SIMD_INLINE Pack Fma(Pack a, Pack b, Pack c) { return a * b + c; }

HOLBA_SIMD_INLINE Pack Select(Mask m, Pack a, Pack b) { return m ? a : b; }

// base[idx[0]], base[idx[1]], ...
HOLBA_SIMD_INLINE Pack Gather(const double* base, const int64_t* idx) {
#if defined(HOLBA_SIMD_SCALAR)
  return base[idx[0]];
#elif defined(__AVX512F__)
  return _mm512_mask_i64gather_pd(_mm512_setzero_pd(), 0xff, _mm512_loadu_si512(idx), base, 8);
#elif defined(__AVX2__)
  return _mm256_i64gather_pd(base, _mm256_loadu_si256(reinterpret_cast<const __m256i*>(idx)), 8);
#else
  Pack x{};
  for (int i = 0; i < kLanes; ++i) x[i] = base[idx[i]];
  return x;
#endif
}

}  // namespace holba::HOLBA_SIMD_TARGET

#if !defined(HOLBA_SIMD_SCALAR)
namespace holba {

template <>
struct Lanes<HOLBA_SIMD_TARGET::Pack> {
  using Pack = HOLBA_SIMD_TARGET::Pack;
  using Mask = HOLBA_SIMD_TARGET::Mask;
  static HOLBA_SIMD_INLINE Pack Sqrt(Pack x) { return HOLBA_SIMD_TARGET::Sqrt(x); }
  static HOLBA_SIMD_INLINE Pack Abs(Pack x) { return HOLBA_SIMD_TARGET::Abs(x); }
  static HOLBA_SIMD_INLINE Pack SignOf(Pack x) { return HOLBA_SIMD_TARGET::SignOf(x); }
  static HOLBA_SIMD_INLINE Pack Select(Mask m, Pack a, Pack b) { return m ? a : b; }
  static HOLBA_SIMD_INLINE Pack Broadcast(double x) { return HOLBA_SIMD_TARGET::Broadcast(x); }
  static HOLBA_SIMD_INLINE bool Any(Mask m) { return HOLBA_SIMD_TARGET::Any(m); }
};

}  // namespace holba
#endif
