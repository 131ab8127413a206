// SPDX-License-Identifier: BSD-3-Clause
#include "holba/base/check.h"

#include <fmt/format.h>

namespace holba {

void FailCheck(const char* file, int line, const char* condition, const std::string& detail) {
  throw CheckError(fmt::format("{}:{}: check failed: {}{}{}", file, line, condition,
                               detail.empty() ? "" : ": ", detail));
}

}  // namespace holba
