// SPDX-License-Identifier: BSD-3-Clause
// InputError: a bad file or option. Its message names the file, the place in it and the remedy; the
// program prints it and ends with exit status 1, leaving the output untouched.
#pragma once

#include <cstdint>
#include <filesystem>
#include <stdexcept>
#include <string>

namespace holba {

class InputError : public std::runtime_error {
 public:
  explicit InputError(const std::string& message) : std::runtime_error(message) {}
  InputError(const std::filesystem::path& path, const std::string& message)
      : std::runtime_error(path.string() + ": " + message) {}

  // `line` counts from 1.
  static InputError AtLine(const std::filesystem::path& path, uint64_t line,
                           const std::string& message) {
    return InputError(path.string() + ":" + std::to_string(line) + ": " + message);
  }
  // `offset` is the byte at which the offending field begins.
  static InputError AtByte(const std::filesystem::path& path, uint64_t offset,
                           const std::string& message) {
    return InputError(path.string() + ": at byte " + std::to_string(offset) + ": " + message);
  }
};

}  // namespace holba
