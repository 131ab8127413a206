// SPDX-License-Identifier: BSD-3-Clause
// Rows of doubles at several places of memory into packs, one lane each. Whole rows are loaded and
// transposed in registers: with gather instructions, which take one load per element, too, residuals
// and Jacobians of points took 1.8 times as long on Zen 4. Only for X_simd.cc files (targets.h).
#pragma once

#include <cstdint>
#include <utility>

#include "holba/simd/pack.h"

namespace holba::HOLBA_SIMD_TARGET {

#if defined(HOLBA_SIMD_SCALAR)
HOLBA_SIMD_INLINE void Transpose(Pack*) {}
#else
// Exchanges the halves of 2 x 2 blocks of size kSize of a and b.
template <int kSize, size_t... kLane>
HOLBA_SIMD_INLINE void Exchange(Pack* a, Pack* b, std::index_sequence<kLane...>) {
  const Pack low = __builtin_shufflevector(
      *a, *b,
      ((kLane & kSize) ? static_cast<int>(kLane) - kSize + kLanes : static_cast<int>(kLane))...);
  const Pack high = __builtin_shufflevector(
      *a, *b,
      ((kLane & kSize) ? static_cast<int>(kLane) + kLanes : static_cast<int>(kLane) + kSize)...);
  *a = low;
  *b = high;
}
template <int kSize, int kCount>
HOLBA_SIMD_INLINE void TransposeStep(Pack* x) {
  for (int i = 0; i < kCount; ++i) {
    if (!(i & kSize)) Exchange<kSize>(x + i, x + i + kSize, std::make_index_sequence<kLanes>());
  }
}
// kLanes packs as the rows of a square matrix.
HOLBA_SIMD_INLINE void Transpose(Pack* x) {
  TransposeStep<1, kLanes>(x);
  if constexpr (kLanes > 2) TransposeStep<2, kLanes>(x);
  if constexpr (kLanes > 4) TransposeStep<4, kLanes>(x);
}
#endif

// Entries 0 .. N - 1 of the rows at base + idx[lane]: entry k of all of them in out[k]. No byte
// beyond a row is read.
template <int N>
HOLBA_SIMD_INLINE void LoadRows(const double* base, const int64_t* idx, Pack* out) {
#if defined(__AVX512F__)
  int k = 0;
  for (; N - k > 4; k += 8) {
    const int count = N - k < 8 ? N - k : 8;
    const __mmask8 mask = static_cast<__mmask8>((1u << count) - 1);
    Pack x[8];
    for (int l = 0; l < 8; ++l) {
      x[l] = count == 8 ? Load(base + idx[l] + k) : _mm512_maskz_loadu_pd(mask, base + idx[l] + k);
    }
    Transpose(x);
    for (int i = 0; i < count; ++i) out[k + i] = x[i];
  }
  if (k < N) {
    // Two rows of up to four side by side, then a transposition within the halves.
    const __mmask8 mask = static_cast<__mmask8>((1u << (N - k)) - 1);
    const auto half = [&](int l) __attribute__((always_inline)) {
      return _mm256_maskz_loadu_pd(mask, base + idx[l] + k);
    };
    Pack x[4];
    for (int l = 0; l < 4; ++l) {
      x[l] = _mm512_maskz_insertf64x4(0xff, _mm512_zextpd256_pd512(half(l)), half(l + 4), 1);
    }
    TransposeStep<1, 4>(x);
    TransposeStep<2, 4>(x);
    for (int i = 0; i < N - k; ++i) out[k + i] = x[i];
  }
#elif defined(__AVX2__)
  for (int k = 0; k < N; k += 4) {
    const int count = N - k < 4 ? N - k : 4;
    const __m256i mask =
        _mm256_set_epi64x(count > 3 ? -1 : 0, count > 2 ? -1 : 0, count > 1 ? -1 : 0, -1);
    Pack x[4];
    for (int l = 0; l < 4; ++l) {
      x[l] = count == 4 ? Load(base + idx[l] + k) : _mm256_maskload_pd(base + idx[l] + k, mask);
    }
    Transpose(x);
    for (int i = 0; i < count; ++i) out[k + i] = x[i];
  }
#else
  for (int k = 0; k < N; ++k) out[k] = Gather(base + k, idx);
#endif
}

}  // namespace holba::HOLBA_SIMD_TARGET
