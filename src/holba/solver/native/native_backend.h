// SPDX-License-Identifier: BSD-3-Clause
// The native backend: features eliminated in one fused pass, Levenberg-Marquardt on what is left.
#pragma once

#include <memory>

#include "holba/solver/solver.h"

namespace holba {

class ReducedSolver;
namespace native {
class NormalEquations;
}

// Memory and analyses that a solve leaves for the next one.
class NativeWorkspace {
 public:
  NativeWorkspace();
  ~NativeWorkspace();
  struct Data;
  Data& data() { return *data_; }

  // Analyses the problem for the explicit form of the reduced system, with a direct solver for it
  // (null: no block is kept).
  ReducedSolver* BeginExplicit(const Problem& problem, int num_threads);
  native::NormalEquations& equations();

 private:
  std::unique_ptr<Data> data_;
};

SolverSummary SolveNatively(const SolverOptions& options, Problem* problem,
                            NativeWorkspace* workspace);

}  // namespace holba
