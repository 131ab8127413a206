// SPDX-License-Identifier: BSD-3-Clause
// Files packed by bzip2, as the BAL problems are handed out.
#pragma once

#include <cstddef>
#include <filesystem>
#include <limits>
#include <string>
#include <string_view>

namespace holba {

bool IsBzip2(std::string_view bytes);

// The unpacked bytes, at most so many of them; of files of several packed streams all. Throws
// InputError where the file is damaged or ends early.
std::string UnpackBzip2(std::string_view bytes, const std::filesystem::path& path,
                        size_t at_most = std::numeric_limits<size_t>::max());

}  // namespace holba
