// SPDX-License-Identifier: BSD-3-Clause
// Log1p of an array, for log1p_test.cc.
#pragma once

#include <cstddef>

#include "holba/simd/targets.h"

namespace holba {

// n: a multiple of kMaxSimdLanes.
HOLBA_SIMD_DECLARE(void Log1pOfEach(const double* x, size_t n, double* log1p))

}  // namespace holba
