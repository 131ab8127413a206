// SPDX-License-Identifier: BSD-3-Clause
// weigh.h in packs, with plain arguments (simd/targets.h).
#pragma once

#include <cstddef>

#include "holba/problem/loss.h"
#include "holba/simd/targets.h"

namespace holba {

// As many as a residual has (kMaxSlots).
inline constexpr int kMaxWeighedSlots = 5;

struct WeighWork {
  LossType loss;
  double scale;
  double weight;
  size_t count, stride;  // stride: a multiple of kPanelLanes
  double* residuals;
  int dim;
  // Jacobians and their numbers of entries (rows times columns); null: absent.
  double* jacobians[kMaxWeighedSlots];
  int entries[kMaxWeighedSlots];
};

// Multiplies, where it is asked to; adds up costs and squares.
HOLBA_SIMD_DECLARE(void Weigh(const WeighWork& work, bool multiply, double* cost,
                              double* sum_squares))

}  // namespace holba
