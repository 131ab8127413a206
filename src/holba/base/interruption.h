// SPDX-License-Identifier: BSD-3-Clause
// How a program that holds this library as a part of it ends a long call early (the program holba
// itself is ended by its signals, temporary_paths.h).
#pragma once

#include "holba/base/threads.h"

namespace holba {

// Thrown out of a call whose caller wants it to end. No std::exception: what catches those to go on
// with the next photograph must not catch this.
struct Interruption {};

// While one lives, `wants_to_end` is asked each time that the thread it was made on shares work
// among threads (ParallelTasks, also if that thread is the only one), at most every few
// milliseconds; once it says true, Interruption is thrown there. For calls whose results are thrown
// away then, or that are whole at any time: outputs are written in one step (io/files.h).
class InterruptionScope {
 public:
  explicit InterruptionScope(FunctionRef<bool()> wants_to_end);
  ~InterruptionScope();
  InterruptionScope(const InterruptionScope&) = delete;
  InterruptionScope& operator=(const InterruptionScope&) = delete;

 private:
  friend void ThrowIfInterrupted();

  FunctionRef<bool()> wants_to_end_;
  InterruptionScope* outer_;
};

// Throws Interruption if the innermost scope of this thread says so; nothing where there is none.
void ThrowIfInterrupted();

}  // namespace holba
