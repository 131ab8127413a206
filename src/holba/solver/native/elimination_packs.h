// SPDX-License-Identifier: BSD-3-Clause
// What the files X_simd.cc of elimination.h share. Only for those (simd/targets.h).
#pragma once

#include <cstdint>

#include "holba/simd/pack.h"
#include "holba/simd/rows.h"
#include "holba/solver/native/elimination.h"

namespace holba::native::HOLBA_SIMD_TARGET {

using namespace holba::HOLBA_SIMD_TARGET;  // NOLINT: the packs of this target

constexpr int kMaxTangentOfFeature = 6;
constexpr int kMaxRow = kFeatureRow + kMaxPanelSegments * kMaxBlockWidth;
constexpr int kFeaturePacks = kFeatureRow / kLanes;

HOLBA_SIMD_INLINE int Min(int a, int b) { return a < b ? a : b; }

// ---- Single precision storage.

HOLBA_SIMD_INLINE Pack LoadFloats(const float* p) {
#if defined(HOLBA_SIMD_SCALAR)
  return *p;
#elif defined(__AVX512F__)
  return _mm512_cvtps_pd(_mm256_loadu_ps(p));
#elif defined(__AVX2__)
  return _mm256_cvtps_pd(_mm_loadu_ps(p));
#else
  Pack x{};
  for (int i = 0; i < kLanes; ++i) x[i] = p[i];
  return x;
#endif
}
HOLBA_SIMD_INLINE void StoreFloats(Pack x, float* p) {
#if defined(__AVX512F__)
  _mm256_storeu_ps(p, _mm512_cvtpd_ps(x));
#elif defined(__AVX2__)
  _mm_storeu_ps(p, _mm256_cvtpd_ps(x));
#else
  for (int i = 0; i < kLanes; ++i) p[i] = static_cast<float>(Lane(x, i));
#endif
}

// Calls body with the number of packs of a padded width (8, 16, 24) as a constant.
#define HOLBA_WITH_PACKS(padded, call)    \
  do {                                    \
    if ((padded) == 8) {                  \
      constexpr int kPacks = 8 / kLanes;  \
      call;                               \
    } else if ((padded) == 16) {          \
      constexpr int kPacks = 16 / kLanes; \
      call;                               \
    } else {                              \
      constexpr int kPacks = 24 / kLanes; \
      call;                               \
    }                                     \
  } while (false)

// The same with the tangent of the features: 3 (points), 4 (lines), others.
#define HOLBA_TANGENT_CASE(label, tangent, call) \
  label : {                                      \
    constexpr int kTangent = tangent;            \
    call;                                        \
    break;                                       \
  }
#define HOLBA_WITH_TANGENT(tangent, call)  \
  do {                                     \
    switch (tangent) {                     \
      HOLBA_TANGENT_CASE(case 1, 1, call)  \
      HOLBA_TANGENT_CASE(case 2, 2, call)  \
      HOLBA_TANGENT_CASE(case 3, 3, call)  \
      HOLBA_TANGENT_CASE(case 4, 4, call)  \
      HOLBA_TANGENT_CASE(case 5, 5, call)  \
      HOLBA_TANGENT_CASE(default, 6, call) \
    }                                      \
  } while (false)

// Of block (a, b), full pattern.
HOLBA_SIMD_INLINE size_t RowBlockOffset(const Sums& sums, uint32_t a, uint32_t b) {
  return sums.row_offset[a] + size_t{sums.unknown_offset[b]} * GroupedRows(sums.width[a]) +
         size_t{sums.padded_offset[b]} * TailRows(sums.width[a]);
}

}  // namespace holba::native::HOLBA_SIMD_TARGET
