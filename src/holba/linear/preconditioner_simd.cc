// SPDX-License-Identifier: BSD-3-Clause
// Inner loop of the Schur complement of BorderPreconditioner.
#include "holba/simd/pack.h"

namespace holba::HOLBA_SIMD_TARGET {
namespace {

// kInner: `inner` where it is known (poses, and poses with their own intrinsics), else 0.
template <int kInner>
HOLBA_SIMD_INLINE void Subtract(int padded_rows, int inner, int columns, const double* h,
                                const double* b, size_t b_row_stride, size_t b_column_stride,
                                double* c) {
  const int num_inner = kInner > 0 ? kInner : inner;
  for (int j = 0; j < columns; ++j, b += b_row_stride, c += padded_rows) {
    for (int i = 0; i < padded_rows; i += kLanes) {
      // Two sums: one would wait for the latency of each addition.
      Pack sum = Load(c + i), other_sum{};
      const double* h_i = h + i;
      int k = 0;
#pragma GCC unroll 4
      for (; k + 1 < num_inner; k += 2) {
        sum = sum - Load(h_i + k * padded_rows) * Broadcast(b[k * b_column_stride]);
        other_sum =
            other_sum - Load(h_i + (k + 1) * padded_rows) * Broadcast(b[(k + 1) * b_column_stride]);
      }
      if (k < num_inner) {
        sum = sum - Load(h_i + k * padded_rows) * Broadcast(b[k * b_column_stride]);
      }
      Store(sum + other_sum, c + i);
    }
  }
}

}  // namespace

// C -= H B^T. H and C: column by column, `padded_rows` (a multiple of 8) doubles each. H has
// `inner` columns, C has `columns`; entry (j, k) of B is b[j * b_row_stride + k * b_column_stride].
void SubtractProduct(int padded_rows, int inner, int columns, const double* h, const double* b,
                     size_t b_row_stride, size_t b_column_stride, double* c) {
  if (inner == 6 && padded_rows == 8) {
    Subtract<6>(8, inner, columns, h, b, b_row_stride, b_column_stride, c);
  } else if (inner == 6) {
    Subtract<6>(padded_rows, inner, columns, h, b, b_row_stride, b_column_stride, c);
  } else {
    Subtract<0>(padded_rows, inner, columns, h, b, b_row_stride, b_column_stride, c);
  }
}

}  // namespace holba::HOLBA_SIMD_TARGET
