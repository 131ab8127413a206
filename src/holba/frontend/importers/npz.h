// SPDX-License-Identifier: BSD-3-Clause
// numpy's files: .npy (one array) and .npz (a zip archive of them, stored or deflated, also with
// zip64 records). Versions 1 to 3 of npy, numbers of 1 to 8 bytes in either byte order, C and
// Fortran order; no pickled objects, structures or texts.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "holba/frontend/importers/import_arrays.h"

namespace holba {

// `place` is for messages: the file, and the entry of an archive. Throws InputError.
NumericArray ParseNpy(std::string_view bytes, const std::string& place);

// An archive in memory; its arrays are unpacked when they are asked for.
class NpzArchive {
 public:
  // Reads the table of contents. Throws InputError.
  NpzArchive(std::string bytes, const std::filesystem::path& path);

  // Names of the arrays (without ".npy"), ascending.
  std::vector<std::string> Names() const;
  bool Contains(const std::string& name) const { return entries_.contains(name); }
  // The name must be one of them. Throws InputError.
  NumericArray Read(const std::string& name) const;

 private:
  struct Entry {
    uint64_t header_offset = 0;  // of the local header
    uint64_t packed_size = 0;
    uint64_t size = 0;
    uint32_t crc32 = 0;
    uint16_t method = 0;
  };
  [[noreturn]] void Fail(const std::string& message) const;
  std::string Unpack(const std::string& name, const Entry& entry) const;

  std::string bytes_;
  std::filesystem::path path_;
  std::map<std::string, Entry> entries_;
};

}  // namespace holba
