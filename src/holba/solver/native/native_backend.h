// SPDX-License-Identifier: BSD-3-Clause
// The native backend: Levenberg-Marquardt on the reduced system of the kept blocks.
#pragma once

#include "holba/solver/native/native_workspace.h"
#include "holba/solver/solver.h"

namespace holba {

SolverSummary SolveNatively(const SolverOptions& options, Problem* problem,
                            NativeWorkspace* workspace);

}  // namespace holba
