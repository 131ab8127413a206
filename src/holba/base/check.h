// SPDX-License-Identifier: BSD-3-Clause
// CHECK: guards against our own faults (never against user input). A failed check throws CheckError.
#pragma once

#include <stdexcept>
#include <string>

namespace holba {

// A broken promise inside the program: a bug, not bad input.
class CheckError : public std::logic_error {
 public:
  using std::logic_error::logic_error;
};

[[noreturn]] void FailCheck(const char* file, int line, const char* condition,
                            const std::string& detail);

}  // namespace holba

#define HOLBA_CHECK(condition)                                          \
  do {                                                                  \
    if (!(condition)) ::holba::FailCheck(__FILE__, __LINE__, #condition, ""); \
  } while (false)

#define HOLBA_CHECK_MSG(condition, detail)                                      \
  do {                                                                          \
    if (!(condition)) ::holba::FailCheck(__FILE__, __LINE__, #condition, (detail)); \
  } while (false)
