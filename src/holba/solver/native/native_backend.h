// SPDX-License-Identifier: BSD-3-Clause
// The native backend: features eliminated in one fused pass, Levenberg-Marquardt on what is left.
#pragma once

#include "holba/solver/solver.h"

namespace holba {

SolverSummary SolveNatively(const SolverOptions& options, Problem* problem);

}  // namespace holba
