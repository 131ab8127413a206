// SPDX-License-Identifier: BSD-3-Clause
// Words that say how something in the database was made: what was made with others is made anew.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>

#include "holba/base/options.h"

namespace holba {

// "NAME option=value ...": all options.
template <typename Options>
std::string SettingsText(const std::string& name, const Options& options) {
  return name + TextOfOptions(options);
}

inline constexpr uint64_t kEmptyHash = 0xcbf29ce484222325ULL;

// FNV-1a: what was made from other bytes was made with other settings.
uint64_t HashBytes(const void* data, size_t size, uint64_t hash = kEmptyHash);

// Of a file's bytes, eight at a time; 0: there is no such file, which its reader will say.
uint64_t HashFile(const std::filesystem::path& path);

}  // namespace holba
