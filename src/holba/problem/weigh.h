// SPDX-License-Identifier: BSD-3-Clause
// Cost of evaluated residuals, and their weighting by weight and robust loss.
#pragma once

#include <cstddef>

#include "holba/problem/residual_batch.h"

namespace holba {

// Cost of the present residuals of a panel. The order of the sums depends on nothing but the count
// and the instruction set (simd/targets.h).
struct PanelCost {
  double cost = 0.0;         // sum of weight * rho(s) / 2, s the squared norm of a residual
  double sum_squares = 0.0;  // sum of s
  size_t absent = 0;
};

PanelCost CostOfPanel(const ResidualBatch& batch, size_t count, const ResidualPanel& panel);

// The same, and multiplies residuals and Jacobians by sqrt(weight * rho'(s)). There is no term of
// second order, as in Ceres, since rho'' <= 0 for every loss.
PanelCost WeighPanel(const ResidualBatch& batch, size_t count, const ResidualPanel& panel);

}  // namespace holba
