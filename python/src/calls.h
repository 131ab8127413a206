// SPDX-License-Identifier: BSD-3-Clause
// Long calls from Python: the interpreter's lock is released, and Ctrl-C ends them.
#pragma once

#include <nanobind/nanobind.h>

#include <utility>

#include "holba/base/interruption.h"

namespace holba::python {

namespace nb = nanobind;

// Whether a signal handler of Python raised (Ctrl-C does). To be called with or without the lock;
// signals are handled on the main thread only, on others it says false. The exception waits for
// ThrowPending.
bool SignalCame();

// Calls f() without the interpreter's lock.
template <typename F>
auto Unlocked(const F& f) {
  nb::gil_scoped_release unlocked;
  return f();
}

// The same for calls that may be ended anywhere: what they were to give is thrown away, and the
// exception of the signal is raised.
template <typename F>
auto Interruptible(const F& f) {
  try {
    nb::gil_scoped_release unlocked;
    const auto ask = [] { return SignalCame(); };
    const InterruptionScope scope(ask);
    return f();
  } catch (const Interruption&) {
    throw nb::python_error();  // what SignalCame left
  }
}

}  // namespace holba::python
