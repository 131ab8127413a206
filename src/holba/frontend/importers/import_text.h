// SPDX-License-Identifier: BSD-3-Clause
// Text files of importers, line by line: words separated by blanks, '#' begins a comment line,
// numbers independent of the locale.
#pragma once

#include <charconv>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>
#include <vector>

#include "holba/base/error.h"

namespace holba {

class ImportLines {
 public:
  ImportLines(std::string_view bytes, const std::filesystem::path& path)
      : bytes_(bytes), path_(path) {
    if (bytes_.starts_with("\xEF\xBB\xBF")) at_ = 3;  // byte order mark
  }

  // The next line, without blanks around it; comments are skipped, blank lines are not. Empty: the
  // end of the file.
  std::optional<std::string_view> Next() {
    while (at_ < bytes_.size()) {
      const size_t end = std::min(bytes_.find('\n', at_), bytes_.size());
      std::string_view line = bytes_.substr(at_, end - at_);
      at_ = end + 1;
      ++line_;
      while (!line.empty() && IsBlank(line.front())) line.remove_prefix(1);
      while (!line.empty() && IsBlank(line.back())) line.remove_suffix(1);
      if (!line.starts_with('#')) return line;
    }
    return std::nullopt;
  }

  static std::vector<std::string_view> Words(std::string_view line) {
    std::vector<std::string_view> words;
    for (size_t at = 0; at < line.size();) {
      if (IsBlank(line[at])) {
        ++at;
        continue;
      }
      const size_t begin = at;
      while (at < line.size() && !IsBlank(line[at])) ++at;
      words.push_back(line.substr(begin, at - begin));
    }
    return words;
  }

  // Empty: not a finite number.
  static std::optional<double> Real(std::string_view word) {
    double value;
    const char* end_of_word = word.data() + word.size();
    const auto [end, error] = std::from_chars(word.data(), end_of_word, value);
    if (error != std::errc() || end != end_of_word || !std::isfinite(value)) return std::nullopt;
    return value;
  }
  // Empty: not a whole number of 0 or more.
  static std::optional<uint64_t> Number(std::string_view word) {
    uint64_t value;
    const char* end_of_word = word.data() + word.size();
    const auto [end, error] = std::from_chars(word.data(), end_of_word, value);
    if (error != std::errc() || end != end_of_word) return std::nullopt;
    return value;
  }

  [[noreturn]] void Fail(const std::string& message) const {
    throw InputError::AtLine(path_, line_, message);
  }
  std::string Place() const { return path_.string() + ":" + std::to_string(line_); }
  // What a message shows of a damaged line.
  static std::string Shown(std::string_view text) { return std::string(text.substr(0, 60)); }

 private:
  static bool IsBlank(char c) { return c == ' ' || c == '\t' || c == '\r'; }

  std::string_view bytes_;
  const std::filesystem::path path_;
  size_t at_ = 0;
  uint64_t line_ = 0;
};

}  // namespace holba
