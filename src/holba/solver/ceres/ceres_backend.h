// SPDX-License-Identifier: BSD-3-Clause
// The Ceres backend: features in elimination group 0, kept blocks in group 1.
#pragma once

#include "holba/solver/solver.h"

namespace holba {

SolverSummary SolveWithCeres(const SolverOptions& options, Problem* problem);

}  // namespace holba
