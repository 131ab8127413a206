// SPDX-License-Identifier: BSD-3-Clause
#include "holba/io/text_io.h"

#include "holba/base/file_faults.h"
#include "holba/base/log.h"

namespace holba {
namespace {

// Words of a damaged file are cut in messages.
constexpr size_t kMaxWordInMessage = 40;

}  // namespace

TextIn::TextIn(std::string_view bytes, const std::filesystem::path& path)
    : bytes_(bytes), path_(path) {
  constexpr std::string_view kByteOrderMark = "\xEF\xBB\xBF";
  if (bytes_.starts_with(kByteOrderMark)) next_ = kByteOrderMark.size();
  RefuseUtf16(bytes_, path_);
}

bool TextIn::Advance() {
  if (next_ >= bytes_.size()) return false;
  p_ = bytes_.data() + next_;
  const char* file_end = bytes_.data() + bytes_.size();
  const void* newline = std::memchr(p_, '\n', static_cast<size_t>(file_end - p_));
  line_end_ = newline != nullptr ? static_cast<const char*>(newline) : file_end;
  next_ = static_cast<size_t>(line_end_ - bytes_.data()) + 1;
  ++line_;
  return true;
}

bool TextIn::NextRecord() {
  while (Advance()) {
    if (!AtRecordEnd() && *p_ != '#') return true;
  }
  return false;
}

void TextIn::NextRawLine(const char* what) {
  if (Advance()) return;
  LogWarning("{}: the file ends after line {}, without the line of {}, which is taken as empty",
             path_.string(), line_, what);
  p_ = line_end_;
}

void TextIn::EndRecord() {
  if (AtRecordEnd()) return;
  Fail("expected the end of the line, found '" +
       std::string(PeekWord().substr(0, kMaxWordInMessage)) + "'");
}

std::string_view TextIn::Rest(const char* what, const char* kind) {
  if (AtRecordEnd()) FailField(what, kind);
  const char* end = line_end_;
  while (IsBlank(end[-1])) --end;
  const std::string_view rest(p_, static_cast<size_t>(end - p_));
  p_ = line_end_;
  return rest;
}

std::string_view TextIn::PeekWord() const {
  const char* end = p_;
  while (end != line_end_ && !IsBlank(*end)) ++end;
  return {p_, static_cast<size_t>(end - p_)};
}

void TextIn::FailField(const char* what, const char* kind) const {
  std::string found;
  if (p_ != line_end_) {
    found = "'" + std::string(PeekWord().substr(0, kMaxWordInMessage)) + "'";
  } else if (next_ > bytes_.size()) {
    found = "the end of the file: it is truncated";
  } else {
    found = "the end of the line";
  }
  Fail(std::string("expected ") + what + " (" + kind + "), found " + found);
}

std::string RealToText(double value) {
  char text[40];
  return {text,
          std::to_chars(text, text + sizeof(text), value, std::chars_format::general, 17).ptr};
}

}  // namespace holba
