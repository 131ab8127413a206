// SPDX-License-Identifier: BSD-3-Clause
// Product of a symmetric block matrix with a vector (block_kernels.h), compiled once for each
// instruction set.
#include "holba/linear/block_kernels.h"
#include "holba/simd/pack.h"

namespace holba::HOLBA_SIMD_TARGET {
namespace {

constexpr int kMaxParts = 24 / kLanes;  // BlockPattern::kMaxWidth

// Lane j is the sum of the lanes of x[j].
#if !defined(HOLBA_SIMD_SCALAR) && HOLBA_SIMD_BYTES == 64
HOLBA_SIMD_INLINE Pack SumEach(const Pack* x) {
  const auto pairs = [](Pack a, Pack b) __attribute__((always_inline)) {
    return __builtin_shuffle(a, b, Mask{0, 8, 2, 10, 4, 12, 6, 14}) +
           __builtin_shuffle(a, b, Mask{1, 9, 3, 11, 5, 13, 7, 15});
  };
  const auto fours = [](Pack a, Pack b) __attribute__((always_inline)) {
    return __builtin_shuffle(a, b, Mask{0, 1, 8, 9, 4, 5, 12, 13}) +
           __builtin_shuffle(a, b, Mask{2, 3, 10, 11, 6, 7, 14, 15});
  };
  const Pack low = fours(pairs(x[0], x[1]), pairs(x[2], x[3]));
  const Pack high = fours(pairs(x[4], x[5]), pairs(x[6], x[7]));
  return __builtin_shuffle(low, high, Mask{0, 1, 2, 3, 8, 9, 10, 11}) +
         __builtin_shuffle(low, high, Mask{4, 5, 6, 7, 12, 13, 14, 15});
}
#else
HOLBA_SIMD_INLINE Pack SumEach(const Pack* x) {
#if defined(HOLBA_SIMD_SCALAR)
  return x[0];
#else
  Pack sums{};
  for (int j = 0; j < kLanes; ++j) sums[j] = Sum(x[j]);
  return sums;
#endif
}
#endif

// kParts registers hold a block column. Lanes past the width are masked: padding may be anything.
template <int kParts>
void MultiplyRow(int num_blocks, int width, const int* column, const int* widths,
                 const size_t* offset, const size_t* block_offset, const double* values,
                 const double* x, double* y) {
  const int stride = (width + 7) / 8 * 8;
  const size_t row = offset[column[num_blocks - 1]];
  Pack own_x[kParts];
  Pack own_y[kParts] = {};
  Mask used[kParts];
  for (int r = 0; r < kParts; ++r) {
#if defined(HOLBA_SIMD_SCALAR)
    used[r] = r < width;
#else
    for (int i = 0; i < kLanes; ++i) used[r][i] = r * kLanes + i < width ? -1 : 0;
#endif
    own_x[r] = Load(x + row + r * kLanes);
  }
  for (int k = 0; k < num_blocks; ++k) {
    const double* block = values + block_offset[k];
    const size_t other = offset[column[k]];
    const bool diagonal = k == num_blocks - 1;
    const int num_columns = widths[column[k]];
    for (int begin = 0; begin < num_columns; begin += kLanes) {
      Pack sum[kLanes];
#pragma GCC unroll 8
      for (int j = 0; j < kLanes; ++j) {
        sum[j] = Pack{};
        if (begin + j >= num_columns) continue;
        const Pack factor = Broadcast(x[other + begin + j]);
#pragma GCC unroll 16
        for (int r = 0; r < kParts; ++r) {
          const Pack loaded = Load(block + (begin + j) * stride + r * kLanes);
          const Pack entry = used[r] ? loaded : Pack{};
          own_y[r] += entry * factor;
          sum[j] += entry * own_x[r];
        }
      }
      // The lanes past the columns add zero.
      double* at = y + other + begin;
      if (!diagonal) Store(Load(at) + SumEach(sum), at);
    }
  }
  for (int r = 0; r < kParts; ++r)
    Store(Load(y + row + r * kLanes) + own_y[r], y + row + r * kLanes);
}

template <int kParts>
void Dispatch(int num_blocks, int width, const int* column, const int* widths, const size_t* offset,
              const size_t* block_offset, const double* values, const double* x, double* y) {
  if constexpr (kParts < kMaxParts) {
    if (width > kParts * kLanes) {
      return Dispatch<kParts + 1>(num_blocks, width, column, widths, offset, block_offset, values,
                                  x, y);
    }
  }
  MultiplyRow<kParts>(num_blocks, width, column, widths, offset, block_offset, values, x, y);
}

}  // namespace

void MultiplyBlockRow(int num_blocks, int width, const int* column, const int* widths,
                      const size_t* offset, const size_t* block_offset, const double* values,
                      const double* x, double* y) {
  Dispatch<1>(num_blocks, width, column, widths, offset, block_offset, values, x, y);
}

}  // namespace holba::HOLBA_SIMD_TARGET
