// SPDX-License-Identifier: BSD-3-Clause
#include "holba/base/progress.h"

#include <fmt/format.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <mutex>
#include <utility>
#include <vector>

namespace holba {
namespace {

constexpr double kSecondsBetweenUpdates = 0.2;
constexpr size_t kBarLetters = 24;

// Of the one terminal.
struct ProgressLine {
  std::mutex mutex;
  bool is_wanted = false;
  bool is_there = false;
  std::vector<const Progress*> running;  // the last one has the line
};
ProgressLine& Line() {
  static ProgressLine line;
  return line;
}

void RemoveLine(ProgressLine* line) {
  if (!line->is_there) return;
  std::fputs("\r\x1b[K", stderr);
  std::fflush(stderr);
  line->is_there = false;
}

size_t TerminalColumns() {
  winsize size{};
  if (ioctl(STDERR_FILENO, TIOCGWINSZ, &size) != 0 || size.ws_col == 0) return 80;
  return size.ws_col;
}

std::string Clock(double seconds) {
  const auto whole = static_cast<long long>(std::llround(seconds));
  if (whole < 3600) return fmt::format("{}:{:02}", whole / 60, whole % 60);
  return fmt::format("{}:{:02}:{:02}", whole / 3600, whole / 60 % 60, whole % 60);
}

}  // namespace

std::string ProgressText(const std::string& what, const std::string& units, size_t num_done,
                         size_t total, double seconds, size_t max_length) {
  const size_t filled = total > 0 ? kBarLetters * std::min(num_done, total) / total : kBarLetters;
  std::string text = fmt::format("{} [{}{}] {} / {} {}", what, std::string(filled, '#'),
                                 std::string(kBarLetters - filled, '-'), num_done, total, units);
  if (num_done > 0 && seconds > 0.0) {
    const double rate = static_cast<double>(num_done) / seconds;
    if (rate >= 0.1) text += fmt::format(", {:.{}f} {}/s", rate, rate < 10.0 ? 2 : 0, units);
    if (num_done < total)
      text += fmt::format(", {} left", Clock(static_cast<double>(total - num_done) / rate));
  }
  if (text.size() > max_length) text.resize(max_length);
  return text;
}

void ShowProgress(bool on) {
  const std::lock_guard lock(Line().mutex);
  Line().is_wanted = on;
}

Progress::Progress(std::string what, std::string units, size_t total)
    : what_(std::move(what)), units_(std::move(units)), total_(total) {
  ProgressLine& line = Line();
  const std::lock_guard lock(line.mutex);
  is_shown_ = line.is_wanted && isatty(STDERR_FILENO) == 1;
  if (!is_shown_) return;
  RemoveLine(&line);
  line.running.push_back(this);
}

Progress::~Progress() {
  if (!is_shown_) return;
  ProgressLine& line = Line();
  const std::lock_guard lock(line.mutex);
  if (line.running.back() == this) RemoveLine(&line);
  std::erase(line.running, this);
}

void Progress::Update(size_t num_done) {
  if (!is_shown_) return;
  const std::lock_guard lock(Line().mutex);
  num_done_ = num_done;
  Show();
}

void Progress::Advance(size_t num_more) {
  if (!is_shown_) return;
  const std::lock_guard lock(Line().mutex);
  num_done_ += num_more;
  Show();
}

void Progress::Show() {
  ProgressLine& line = Line();
  if (line.running.back() != this) return;
  const double seconds = timer_.Seconds();
  if (last_seconds_ >= 0.0 && seconds - last_seconds_ < kSecondsBetweenUpdates &&
      num_done_ < total_)
    return;
  last_seconds_ = seconds;
  line.is_there = true;
  // Back to the line's begin, and what was there before is removed. A line that filled the terminal
  // would be continued on the next.
  const std::string text =
      ProgressText(what_, units_, num_done_, total_, seconds, TerminalColumns() - 1);
  std::fprintf(stderr, "\r%s\x1b[K", text.c_str());
  std::fflush(stderr);
}

void ClearProgressLine() {
  const std::lock_guard lock(Line().mutex);
  RemoveLine(&Line());
}

}  // namespace holba
