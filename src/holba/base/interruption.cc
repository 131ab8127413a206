// SPDX-License-Identifier: BSD-3-Clause
#include "holba/base/interruption.h"

#include <chrono>

namespace holba {
namespace {

// Short to a person, long to the work between two looks.
constexpr std::chrono::milliseconds kBetweenLooks{20};

thread_local InterruptionScope* innermost = nullptr;
thread_local std::chrono::steady_clock::time_point next_look;

}  // namespace

InterruptionScope::InterruptionScope(FunctionRef<bool()> wants_to_end)
    : wants_to_end_(wants_to_end), outer_(innermost) {
  innermost = this;
  next_look = {};
}

InterruptionScope::~InterruptionScope() { innermost = outer_; }

void ThrowIfInterrupted() {
  if (innermost == nullptr) return;
  const auto now = std::chrono::steady_clock::now();
  if (now < next_look) return;
  next_look = now + kBetweenLooks;
  if (innermost->wants_to_end_()) throw Interruption();
}

}  // namespace holba
