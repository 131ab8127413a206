// SPDX-License-Identifier: BSD-3-Clause
// For tests: binary files that stand in their sources, and what pages hold.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace holba {

inline std::string FromBase64(std::string_view text) {
  constexpr std::string_view kDigits =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string bytes;
  uint32_t bits = 0;
  int num_bits = 0;
  for (const char c : text) {
    if (c == '=') break;
    bits = bits << 6 | static_cast<uint32_t>(kDigits.find(c));
    num_bits += 6;
    if (num_bits < 8) continue;
    num_bits -= 8;
    bytes.push_back(static_cast<char>(bits >> num_bits & 0xffu));
  }
  return bytes;
}

}  // namespace holba
