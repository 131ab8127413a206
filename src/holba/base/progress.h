// SPDX-License-Identifier: BSD-3-Clause
// How far a long job is: one line on a terminal, rewritten as the job goes on. Nothing where stderr
// is no terminal. Not for several threads at a time.
#pragma once

#include <cstddef>
#include <string>

#include "holba/base/timer.h"

namespace holba {

class Progress {
 public:
  // "what 12 / 340 units, 3.10 units/s, 1:46 left". `is_wanted`: false shows nothing.
  Progress(std::string what, std::string units, size_t total, bool is_wanted = true);
  ~Progress();  // removes the line
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  // At most some times a second, whatever the number of calls.
  void Update(size_t num_done);
  // Before a message, so that it begins on a line of its own.
  void Clear();

 private:
  std::string what_, units_;
  size_t total_;
  bool is_shown_ = false;
  bool has_line_ = false;
  double last_seconds_ = -1.0;
  Timer timer_;
};

// The line's text, for `seconds` since the start.
std::string ProgressText(const std::string& what, const std::string& units, size_t num_done,
                         size_t total, double seconds);

}  // namespace holba
