// SPDX-License-Identifier: BSD-3-Clause
// The backends of Solve: one line in the list of backend.cc each, and a folder of their own.
#pragma once

#include <span>
#include <string_view>

#include "holba/solver/solver.h"

namespace holba {

struct BackendEntry {
  std::string_view name;  // of the option Solver.backend
  Backend backend;
  SolverSummary (*solve)(const SolverOptions& options, Problem* problem,
                         SolverWorkspace* workspace);
};

// Those of this build.
std::span<const BackendEntry> AllBackends();

}  // namespace holba
