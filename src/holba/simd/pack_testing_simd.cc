// SPDX-License-Identifier: BSD-3-Clause
// Operations of pack.h on plain arrays, for pack_test.cc.
#include "holba/simd/pack.h"
#include "holba/simd/pack_testing.h"
#include "holba/simd/rows.h"

namespace holba::HOLBA_SIMD_TARGET {
namespace {

template <int N>
void LoadRowsIfAsked(int n, const double* base, const int64_t* idx, double* out) {
  if constexpr (N > 0) {
    if (n != N) return LoadRowsIfAsked<N - 1>(n, base, idx, out);
    Pack x[N];
    LoadRows<N>(base, idx, x);
    for (int k = 0; k < N; ++k) {
      for (int l = 0; l < kLanes; ++l) out[k * kMaxSimdLanes + l] = Lane(x[k], l);
    }
  }
}

}  // namespace

int LoadRowsInto(int n, const double* base, const int64_t* idx, double* out) {
  LoadRowsIfAsked<kMaxTestedRow>(n, base, idx, out);
  return kLanes;
}

int ComputePacks(const double* a, const double* b, const double* table, const int64_t* idx,
                 PackResults* results) {
  const Pack x = Load(a), y = Load(b);
  const Mask less = x < y;
  Store(Fma(x, y, Broadcast(0.5)), results->fma);
  Store(Sqrt(Abs(x)), results->sqrt_abs);
  Store(Select(less, y, x), results->larger);
  Store(Gather(table, idx), results->gathered);
  for (int i = 0; i < kLanes; ++i) results->less[i] = MaskLane(less, i);
  results->any_less = Any(less);
  results->all_less = All(less);
  results->sum = Sum(x);
  return kLanes;
}

}  // namespace holba::HOLBA_SIMD_TARGET
