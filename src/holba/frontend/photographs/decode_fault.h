// SPDX-License-Identifier: BSD-3-Clause
// What is said of a picture that cannot be decoded, whatever its format.
#pragma once

#include <fmt/format.h>

#include <filesystem>
#include <string_view>

#include "holba/base/error.h"

namespace holba {

// `format`: "PNG"; `why`: "it ends too early".
inline InputError CannotBeDecoded(const std::filesystem::path& path, std::string_view format,
                                  std::string_view why) {
  return InputError(path, fmt::format("the {} file cannot be decoded ({}); save it anew, in RGB or "
                                      "grey with 8 bits a channel, under the same name",
                                      format, why));
}

}  // namespace holba
