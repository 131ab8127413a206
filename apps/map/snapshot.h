// SPDX-License-Identifier: BSD-3-Clause
// The last whole state of a mapping run, in a hidden file beside its output, from which a run that
// was killed is gone on with.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

namespace holba {

class SnapshotFile {
 public:
  // `options`: a line "name=value" for each that a run must share with the one that it goes on
  // from. `fingerprint`: of the images and matches.
  SnapshotFile(const std::filesystem::path& output_path, std::string options, uint64_t fingerprint);

  bool Exists() const;
  // The state. Empty: there is no snapshot, or none of this version. Throws InputError for one of
  // other options, images or matches.
  std::optional<std::string> Read() const;
  // As a whole or not at all. Says once on the log if it cannot be done.
  void Write(const std::string& state);
  void Remove() const;

 private:
  std::filesystem::path path_;
  std::string options_;
  uint64_t fingerprint_;
  bool has_failed_ = false;
};

}  // namespace holba
