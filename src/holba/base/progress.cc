// SPDX-License-Identifier: BSD-3-Clause
#include "holba/base/progress.h"

#include <fmt/format.h>
#include <unistd.h>

#include <cmath>
#include <cstdio>
#include <utility>

namespace holba {
namespace {

constexpr double kSecondsBetween = 0.2;

std::string Clock(double seconds) {
  const auto whole = static_cast<long long>(std::llround(seconds));
  if (whole < 3600) return fmt::format("{}:{:02}", whole / 60, whole % 60);
  return fmt::format("{}:{:02}:{:02}", whole / 3600, whole / 60 % 60, whole % 60);
}

}  // namespace

std::string ProgressText(const std::string& what, const std::string& units, size_t num_done,
                         size_t total, double seconds) {
  std::string text = fmt::format("{} {} / {} {}", what, num_done, total, units);
  if (num_done == 0 || !(seconds > 0.0)) return text;
  const double rate = static_cast<double>(num_done) / seconds;
  text += fmt::format(", {:.{}f} {}/s", rate, rate < 10.0 ? 2 : 0, units);
  if (num_done < total)
    text += fmt::format(", {} left", Clock(static_cast<double>(total - num_done) / rate));
  return text;
}

Progress::Progress(std::string what, std::string units, size_t total, bool is_wanted)
    : what_(std::move(what)),
      units_(std::move(units)),
      total_(total),
      is_shown_(is_wanted && isatty(STDERR_FILENO) == 1) {}

Progress::~Progress() { Clear(); }

void Progress::Update(size_t num_done) {
  if (!is_shown_) return;
  const double seconds = timer_.Seconds();
  if (last_seconds_ >= 0.0 && seconds - last_seconds_ < kSecondsBetween && num_done < total_)
    return;
  last_seconds_ = seconds;
  has_line_ = true;
  // Back to the line's begin, and what was there before is removed.
  std::fprintf(stderr, "\r%s\x1b[K",
               ProgressText(what_, units_, num_done, total_, seconds).c_str());
  std::fflush(stderr);
}

void Progress::Clear() {
  if (!has_line_) return;
  std::fputs("\r\x1b[K", stderr);
  std::fflush(stderr);
  has_line_ = false;
}

}  // namespace holba
