// SPDX-License-Identifier: BSD-3-Clause
#include "holba/base/printable.h"

#include <fmt/format.h>

#include <cstdint>

namespace holba {
namespace {

// Bytes of the character at the start of `text`; 0: it is no UTF-8, or a control character.
size_t LengthOfPrintable(std::string_view text) {
  const auto byte = [&](size_t i) { return static_cast<uint8_t>(text[i]); };
  const uint8_t first = byte(0);
  if (first < 0x80) return (first >= 0x20 && first != 0x7f) || first == '\n' || first == '\t';
  const size_t length = first >= 0xf0 ? 4 : first >= 0xe0 ? 3 : 2;
  if (first < 0xc2 || first > 0xf4 || text.size() < length) return 0;
  for (size_t i = 1; i < length; ++i) {
    if ((byte(i) & 0xc0) != 0x80) return 0;
  }
  // Control characters of Latin-1, long forms of short characters, surrogates, beyond Unicode.
  const uint8_t second = byte(1);
  const bool is_bad = (first == 0xc2 && second < 0xa0) || (first == 0xe0 && second < 0xa0) ||
                      (first == 0xed && second >= 0xa0) || (first == 0xf0 && second < 0x90) ||
                      (first == 0xf4 && second >= 0x90);
  return is_bad ? 0 : length;
}

}  // namespace

std::string Printable(std::string_view text) {
  std::string printable;
  printable.reserve(text.size());
  while (!text.empty()) {
    const size_t length = LengthOfPrintable(text);
    if (length == 0) {
      printable += fmt::format("\\x{:02x}", static_cast<uint8_t>(text.front()));
    } else {
      printable += text.substr(0, length);
    }
    text.remove_prefix(length == 0 ? 1 : length);
  }
  return printable;
}

}  // namespace holba
