// SPDX-License-Identifier: BSD-3-Clause
// From evaluated residuals to the rows of the normal equations, and their cost.
#pragma once

#include <cstddef>

#include "holba/problem/residual_batch.h"

namespace holba {

// Of the present residuals of a panel. Summed in an order that depends on nothing but the count and
// the instruction set (simd/targets.h).
struct PanelCost {
  double cost = 0.0;         // sum of weight * rho(s) / 2, s the squared norm of a residual
  double sum_squares = 0.0;  // sum of s
  size_t absent = 0;
};

PanelCost CostOfPanel(const ResidualBatch& batch, size_t count, const ResidualPanel& panel);

// The same, and multiplies residuals and Jacobians by sqrt(weight * rho'(s)). rho'' <= 0 for every
// loss, so that there is no term of second order (as in Ceres).
PanelCost WeighPanel(const ResidualBatch& batch, size_t count, const ResidualPanel& panel);

}  // namespace holba
