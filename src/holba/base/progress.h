// SPDX-License-Identifier: BSD-3-Clause
// How far a long job is: one line on a terminal, rewritten as the job goes on. Nothing of it where
// stderr is no terminal, nor in other programs that call this library: a program asks for it.
#pragma once

#include <cstddef>
#include <string>

#include "holba/base/timer.h"

namespace holba {

// Whether progress is shown from now on, if stderr is a terminal. At first it is not.
void ShowProgress(bool on);

class Progress {
 public:
  // "what [####----] 12 / 340 units, 3.10 units/s, 1:46 left". Of several at a time the last that
  // began is shown.
  Progress(std::string what, std::string units, size_t total);
  ~Progress();  // removes the line
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  // From any thread; shown at most some times a second, whatever the number of calls.
  void Update(size_t num_done);
  void Advance(size_t num_more = 1);

 private:
  void Show();

  std::string what_, units_;
  size_t total_, num_done_ = 0;
  bool is_shown_ = false;
  double last_seconds_ = -1.0;
  Timer timer_;
};

// Before a message, so that it begins on a line of its own. The next update shows the line again.
void ClearProgressLine();

// The line's text, for `seconds` since the start; not longer than max_length letters.
std::string ProgressText(const std::string& what, const std::string& units, size_t num_done,
                         size_t total, double seconds, size_t max_length = 200);

}  // namespace holba
