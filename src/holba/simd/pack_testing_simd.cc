// SPDX-License-Identifier: BSD-3-Clause
// Operations of pack.h on plain arrays, for pack_test.cc.
#include "holba/simd/pack.h"
#include "holba/simd/pack_testing.h"

namespace holba::HOLBA_SIMD_TARGET {

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
