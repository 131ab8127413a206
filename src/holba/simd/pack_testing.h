// SPDX-License-Identifier: BSD-3-Clause
// Operations of pack.h and rows.h on plain arrays, for pack_test.cc.
#pragma once

#include <cstddef>
#include <cstdint>

#include "holba/simd/targets.h"

namespace holba {

// Every output has the target's number of lanes, which is returned.
struct PackResults {
  double fma[kMaxSimdLanes], sqrt_abs[kMaxSimdLanes], larger[kMaxSimdLanes],
      gathered[kMaxSimdLanes];
  bool less[kMaxSimdLanes];
  bool any_less, all_less;
  double sum;
};

HOLBA_SIMD_DECLARE(int ComputePacks(const double* a, const double* b, const double* table,
                                    const int64_t* idx, PackResults* results))

// LoadRows<n> for 1 <= n <= kMaxTestedRow: entry k of lane l at out[k * kMaxSimdLanes + l].
inline constexpr int kMaxTestedRow = 16;
HOLBA_SIMD_DECLARE(int LoadRowsInto(int n, const double* base, const int64_t* idx, double* out))

}  // namespace holba
