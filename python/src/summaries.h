// SPDX-License-Identifier: BSD-3-Clause
// What a solve tells Python while it goes on.
#pragma once

#include <nanobind/nanobind.h>

#include <optional>

#include "calls.h"
#include "holba/solver/solver.h"

namespace holba::python {

// Hands iterations to a Python callable (none: nobody), which ends the solve by returning False or
// raising; so does Ctrl-C. The state is then that of the last accepted step, and Finish raises what
// was raised.
class IterationCallback {
 public:
  // To be made and finished with the interpreter's lock, which the solve does not have.
  IterationCallback(nb::object callable, bool logs) : callable_(std::move(callable)), logs_(logs) {}

  bool operator()(const IterationRecord& record);
  void Finish();

 private:
  nb::object callable_;
  bool logs_;
  std::optional<nb::python_error> error_;
};

}  // namespace holba::python
