// SPDX-License-Identifier: BSD-3-Clause
// Numbers with their nouns in messages: "1 image", "2 images".
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace holba {

// `noun`: in the singular, with a regular plural; of several words the last one changes.
inline std::string Counted(size_t count, std::string_view noun) {
  std::string text = std::to_string(count) + " " + std::string(noun);
  if (count == 1) return text;
  const bool hisses =
      noun.ends_with("ch") || noun.ends_with("sh") || noun.ends_with('s') || noun.ends_with('x');
  return text + (hisses ? "es" : "s");
}

// The form of a verb that goes with a number: Agree(n, "is", "are").
inline std::string_view Agree(size_t count, std::string_view singular, std::string_view plural) {
  return count == 1 ? singular : plural;
}

}  // namespace holba
