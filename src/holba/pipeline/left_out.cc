// SPDX-License-Identifier: BSD-3-Clause
#include "holba/pipeline/left_out.h"

#include <fmt/format.h>

#include <algorithm>

#include "holba/base/error.h"
#include "holba/base/log.h"
#include "holba/base/words.h"

namespace holba {
namespace {

// Warnings name this many pictures, and count the others.
constexpr size_t kMaxNumNamed = 10;

}  // namespace

void HandleLeftOut(bool strict, std::span<const LeftOutPhotograph> left_out, size_t num_all,
                   std::string_view consequence) {
  if (left_out.empty()) return;
  const LeftOutPhotograph& first = left_out.front();
  if (strict || left_out.size() == num_all) {
    throw InputError(num_all == 1 ? first.reason
                                  : fmt::format("{} ({} of {} cannot be used)", first.reason,
                                                left_out.size(), Counted(num_all, "photograph")));
  }
  LogWarning("{} of {} {} left out ({}{}--strict 1 stops instead):", left_out.size(),
             Counted(num_all, "photograph"), Agree(left_out.size(), "is", "are"), consequence,
             consequence.empty() ? "" : "; ");
  for (size_t i = 0; i < std::min(kMaxNumNamed, left_out.size()); ++i)
    LogWarning("  {}", left_out[i].reason);
  if (left_out.size() > kMaxNumNamed) LogWarning("  and {} more", left_out.size() - kMaxNumNamed);
}

void WarnOfCutOff(std::span<const std::string> names) {
  if (names.empty()) return;
  std::string listed;
  for (size_t i = 0; i < std::min(kMaxNumNamed, names.size()); ++i)
    listed += (i ? ", " : "") + names[i];
  if (names.size() > kMaxNumNamed)
    listed += fmt::format(" (and {} more)", names.size() - kMaxNumNamed);
  LogWarning("{} {} too early, and what is missing is taken as grey; copy the files anew: {}",
             Counted(names.size(), "photograph"), Agree(names.size(), "ends", "end"), listed);
}

}  // namespace holba
