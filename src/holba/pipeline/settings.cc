// SPDX-License-Identifier: BSD-3-Clause
#include "holba/pipeline/settings.h"

#include <cstring>
#include <system_error>

#include "holba/io/files.h"

namespace holba {
namespace {

constexpr uint64_t kPrime = 0x100000001b3ULL;

}  // namespace

uint64_t HashBytes(const void* data, size_t size, uint64_t hash) {
  for (size_t i = 0; i < size; ++i) hash = (hash ^ static_cast<const uint8_t*>(data)[i]) * kPrime;
  return hash;
}

uint64_t HashFile(const std::filesystem::path& path) {
  std::error_code error;
  if (!std::filesystem::is_regular_file(path, error)) return 0;
  const std::string bytes = ReadFileBytes(path);
  uint64_t hash = kEmptyHash ^ bytes.size();
  size_t i = 0;
  for (; i + sizeof(uint64_t) <= bytes.size(); i += sizeof(uint64_t)) {
    uint64_t word;
    std::memcpy(&word, bytes.data() + i, sizeof(word));
    hash = (hash ^ word) * kPrime;
    hash ^= hash >> 32;  // the high bits of a word reach all others
  }
  return HashBytes(bytes.data() + i, bytes.size() - i, hash);
}

}  // namespace holba
