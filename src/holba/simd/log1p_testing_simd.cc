// SPDX-License-Identifier: BSD-3-Clause
// Log1p of an array, for log1p_test.cc.
#include "holba/simd/log1p.h"
#include "holba/simd/log1p_testing.h"

namespace holba::HOLBA_SIMD_TARGET {

void Log1pOfEach(const double* x, size_t n, double* log1p) {
  for (size_t i = 0; i < n; i += kLanes) Store(Log1p(Load(x + i)), log1p + i);
}

}  // namespace holba::HOLBA_SIMD_TARGET
