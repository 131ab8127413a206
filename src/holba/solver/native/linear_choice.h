// SPDX-License-Identifier: BSD-3-Clause
// Which linear solver has the least predicted work.
#pragma once

#include "holba/linear/block_matrix.h"
#include "holba/solver/native/structure.h"
#include "holba/solver/solver.h"

namespace holba::native {

// Of the two direct ones.
bool IsSparseFaster(const BlockPattern& pattern);

// Never kAuto. `pattern`: of the whole reduced system.
LinearSolver ChooseLinearSolver(const Structure& structure, const BlockPattern& pattern);

}  // namespace holba::native
