// SPDX-License-Identifier: BSD-3-Clause
// The choice of the linear solver with the least predicted work.
#pragma once

#include "holba/linear/block_matrix.h"
#include "holba/solver/native/structure.h"
#include "holba/solver/solver.h"

namespace holba::native {

// Whether a sparse factor is faster than a dense one.
bool IsSparseFaster(const BlockPattern& pattern);

// Never kAuto. `pattern` is that of the explicit form.
LinearSolver ChooseLinearSolver(const Structure& structure, const BlockPattern& pattern);

}  // namespace holba::native
