// SPDX-License-Identifier: BSD-3-Clause
// LIMAP's text files, with the fields of binary_io.h.
#pragma once

#include <fmt/format.h>

#include <cmath>
#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>

#include "holba/io/text_io.h"

namespace holba {

// LIMAP's text: words, wherever lines end.
class WordsIn {
 public:
  static constexpr bool kBinary = false;

  WordsIn(std::string_view bytes, const std::filesystem::path& path)
      : in_(bytes, path), size_(bytes.size()) {}

  uint32_t Index(const char* what) { return Next(what), in_.Index(what); }
  uint64_t Number(const char* what) { return Next(what), in_.Number(what); }
  double Real(const char* what) { return Next(what), in_.Real(what); }
  int32_t Int32(const char* what) {
    const double value = Real(what);
    if (std::abs(value) > 1e6 || std::floor(value) != value)
      in_.Fail(fmt::format("expected {} (a whole number), found {}", what, value));
    return static_cast<int32_t>(value);
  }
  // Each element takes two characters at least.
  size_t Count(const char* what, size_t) {
    const uint64_t count = Number(what);
    if (count > size_ / 2) {
      in_.Fail(fmt::format("expected {} of at most {} in a text of {} bytes, found {}", what,
                           size_ / 2, size_, count));
    }
    return count;
  }
  [[noreturn]] void Fail(const std::string& message) const { in_.Fail(message); }
  void Finish() {
    if (!in_.AtRecordEnd() || in_.NextRecord())
      in_.Fail("expected the end of the file after its last record, found more words");
  }

 private:
  void Next(const char* what) {
    if (in_.AtRecordEnd() && !in_.NextRecord())
      in_.Fail(fmt::format("expected {}, found no more words: the file is truncated", what));
  }

  TextIn in_;
  size_t size_;
};

}  // namespace holba
