// SPDX-License-Identifier: BSD-3-Clause
// Files as wholes: read at once, and written so that either the old output or a whole new one is
// there.
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <ostream>
#include <string>
#include <string_view>

#include "holba/base/temporary_paths.h"

namespace holba {

// All bytes of a regular file. Throws InputError.
std::string ReadFileBytes(const std::filesystem::path& path);

// Writes beside `path`, then renames; creates the parent folders. Throws InputError and leaves what
// was there.
void WriteFileWhole(const std::filesystem::path& path,
                    const std::function<void(std::ostream*)>& write);

// A new version of a folder's files, prepared beside the folder and put in its place by Commit.
// Without Commit nothing is changed and the prepared files are removed.
class StagedFolder {
 public:
  // Creates the parents of `target`. Throws InputError if it is a file or cannot be written.
  explicit StagedFolder(const std::filesystem::path& target);
  ~StagedFolder();
  StagedFolder(const StagedFolder&) = delete;
  StagedFolder& operator=(const StagedFolder&) = delete;

  // Adds a file. Throws InputError if it cannot be written.
  void Write(const std::string& name, const std::function<void(std::ostream*)>& write);

  // Puts the prepared files in place: those files of the old folder that `owned(name)` claims are
  // gone, all others are kept. The folders change places in one step where the system can do it
  // (Linux); else, and if the folder cannot be moved (a mount point, or the current folder of this
  // program), file by file.
  void Commit(const std::function<bool(std::string_view name)>& owned);

 private:
  void CommitFileByFile(const std::function<bool(std::string_view)>& owned);

  std::filesystem::path target_;
  std::filesystem::path stage_;
  std::unique_ptr<TemporaryPath> temporary_;  // removes the stage if the program is interrupted
  bool inside_ = false;  // the stage is in the target, for want of rights beside it
};

}  // namespace holba
