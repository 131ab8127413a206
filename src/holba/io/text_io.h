// SPDX-License-Identifier: BSD-3-Clause
// The text form of records: one per line, fields separated by blanks, lines that are blank or begin
// with
// '#' skipped, numbers independent of the locale, reals with 17 significant digits (nothing is
// lost). The fields are those of binary_io.h.
#pragma once

#include <charconv>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <limits>
#include <ostream>
#include <string>
#include <string_view>
#include <system_error>

#include "holba/base/error.h"
#include "holba/scene/types.h"

namespace holba {

class TextIn {
 public:
  static constexpr bool kBinary = false;

  // `path` is for messages only.
  TextIn(std::string_view bytes, const std::filesystem::path& path);

  void Begin(const char*, size_t) {}
  // Text has two bytes at least for each record.
  size_t NumRecordsAtMost() const { return (bytes_.size() - next_) / 2; }
  // Goes to the next line with fields. False: there is none.
  bool NextRecord();
  // Goes to the next line, whatever it holds. Editors take an empty last line away: at the end of
  // the file the line is empty, with a warning that names `what`.
  void NextRawLine(const char* what);
  void EndRecord();
  void Finish() {}
  // Whether the line has no more fields.
  bool AtRecordEnd() {
    while (p_ != line_end_ && IsBlank(*p_)) ++p_;
    return p_ == line_end_;
  }

  uint8_t Byte(const char* what) { return Integer<uint8_t>(what, "0 to 255"); }
  uint32_t Index(const char* what) { return Integer<uint32_t>(what, "a whole number"); }
  uint64_t Number(const char* what) { return Integer<uint64_t>(what, "a whole number"); }
  uint64_t Id(const char* what) {
    AtRecordEnd();
    if (line_end_ - p_ >= 2 && p_[0] == '-' && p_[1] == '1' &&
        (line_end_ - p_ == 2 || IsBlank(p_[2]))) {
      p_ += 2;
      return kNoId;
    }
    return Integer<uint64_t>(what, "an id, or -1 for none");
  }
  uint64_t Key(const char* what) {
    const uint64_t id = Integer<uint64_t>(what, "an id");
    if (id == kNoId)
      Fail(std::string("expected ") + what + " (an id), found 2^64 - 1, which is none");
    return id;
  }
  uint32_t Key32(const char* what) {
    const uint32_t id = Integer<uint32_t>(what, "an id");
    if (id == kInvalidId32) {
      Fail(std::string("expected ") + what + " (an id), found 2^32 - 1, which is none");
    }
    return id;
  }
  double Real(const char* what) {
    if (AtRecordEnd()) FailField(what, "a finite number");
    const char* begin = p_;
    if (*begin == '+' && line_end_ - begin > 1 && begin[1] != '-') ++begin;
    double value;
    const auto [end, error] = std::from_chars(begin, line_end_, value);
    if (error != std::errc() || (end != line_end_ && !IsBlank(*end)) || !std::isfinite(value)) {
      FailField(what, "a finite number");
    }
    p_ = end;
    return value;
  }
  size_t Count(const char* what, size_t) {
    const uint64_t count = Number(what);
    // An element takes two characters of the line at least.
    if (count > static_cast<uint64_t>(line_end_ - p_) / 2) {
      Fail(std::string("expected ") + what + " elements, found " + std::to_string(count) +
           " announced, more than the line can hold");
    }
    return count;
  }
  size_t Count32(const char* what, size_t min_bytes) { return Count(what, min_bytes); }
  size_t List(const char*, size_t) { return 0; }
  bool More(size_t*) { return !AtRecordEnd(); }

  std::string_view Word(const char* what, const char* kind) {
    if (AtRecordEnd()) FailField(what, kind);
    const std::string_view word = PeekWord();
    p_ += word.size();
    return word;
  }
  // All that is left of the line, without blanks around it; not empty.
  std::string_view Rest(const char* what, const char* kind);

  // In the line of the record.
  [[noreturn]] void Fail(const std::string& message) const {
    throw InputError::AtLine(path_, line_, message);
  }
  [[noreturn]] void FailRecord(const std::string& message) const { Fail(message); }
  uint64_t Place() const { return line_; }
  [[noreturn]] void FailAt(uint64_t place, const std::string& message) const {
    throw InputError::AtLine(path_, place, message);
  }

 private:
  static bool IsBlank(char c) { return c == ' ' || c == '\t' || c == '\r'; }
  // Makes the next line the current one. False: no line is left.
  bool Advance();
  std::string_view PeekWord() const;
  // "expected WHAT (kind), found 'word'".
  [[noreturn]] void FailField(const char* what, const char* kind) const;

  template <typename T>
  T Integer(const char* what, const char* kind) {
    if (AtRecordEnd()) FailField(what, kind);
    T value;
    const auto [end, error] = std::from_chars(p_, line_end_, value);
    if (error != std::errc() || (end != line_end_ && !IsBlank(*end))) FailField(what, kind);
    p_ = end;
    return value;
  }

  std::string_view bytes_;
  const std::filesystem::path path_;
  size_t next_ = 0;  // where the next line begins
  uint64_t line_ = 0;
  const char* p_ = nullptr;
  const char* line_end_ = nullptr;
};

class TextOut {
 public:
  static constexpr bool kBinary = false;

  explicit TextOut(std::ostream* stream) : stream_(stream) {}
  ~TextOut() { Flush(); }
  TextOut(const TextOut&) = delete;
  TextOut& operator=(const TextOut&) = delete;

  void Begin(uint64_t) {}
  void Comment(std::string_view text) {
    buffer_.append("# ").append(text);
    EndRecord();
  }
  void EndRecord() {
    buffer_.push_back('\n');
    line_is_empty_ = true;
    if (buffer_.size() >= kFlushSize) Flush();
  }
  void Byte(uint8_t value) { Number(value); }
  void Index(uint32_t value) { Number(value); }
  void Number(uint64_t value) {
    char text[24];
    Field(text, std::to_chars(text, text + sizeof(text), value).ptr);
  }
  void Id(uint64_t value) {
    if (value == kNoId) {
      Word("-1");
    } else {
      Number(value);
    }
  }
  void Real(double value) {
    char text[40];
    Field(text,
          std::to_chars(text, text + sizeof(text), value, std::chars_format::general, 17).ptr);
  }
  void Count(uint64_t value) { Number(value); }
  void List(uint64_t) {}
  void Word(std::string_view word) { Field(word.data(), word.data() + word.size()); }

 private:
  static constexpr size_t kFlushSize = size_t{1} << 20;

  void Field(const char* begin, const char* end) {
    if (!line_is_empty_) buffer_.push_back(' ');
    line_is_empty_ = false;
    buffer_.append(begin, end);
  }
  void Flush() {
    stream_->write(buffer_.data(), static_cast<std::streamsize>(buffer_.size()));
    buffer_.clear();
  }

  std::ostream* stream_;
  std::string buffer_;
  bool line_is_empty_ = true;
};

// A real as text files hold it.
std::string RealToText(double value);

}  // namespace holba
