// SPDX-License-Identifier: BSD-3-Clause
// The native backend: features eliminated in one fused pass, Levenberg-Marquardt on what is left.
#pragma once

#include <memory>

#include "holba/solver/solver.h"

namespace holba {

// Memory and analyses that a solve leaves for the next one.
class NativeWorkspace {
 public:
  NativeWorkspace();
  ~NativeWorkspace();
  struct Data;
  Data& data() { return *data_; }

 private:
  std::unique_ptr<Data> data_;
};

SolverSummary SolveNatively(const SolverOptions& options, Problem* problem,
                            NativeWorkspace* workspace);

}  // namespace holba
