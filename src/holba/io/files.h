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

#include "holba/base/file_faults.h"
#include "holba/base/temporary_paths.h"

namespace holba {

// Says to other programs that a stage is in use, for as long as this one lives, even if it is
// killed.
class StageLock;

// Writes beside `path`, then renames; creates the parent folders. Throws InputError and leaves what
// was there.
void WriteFileWhole(const std::filesystem::path& path,
                    const std::function<void(std::ostream*)>& write);

// Whether WriteFileWhole or StagedFolder could put something at `path`, found out by trying, before
// the work whose result goes there is begun. Nothing is left behind. Throws InputError with the
// remedy.
void ProbeFile(const std::filesystem::path& path);
// `is_file`: whether a name in the folder will be that of a file of ours; a folder of that name is
// an error.
void ProbeFolder(const std::filesystem::path& path,
                 const std::function<bool(std::string_view name)>& is_file);

// A new version of a folder's files, prepared beside the folder and put in its place by Commit.
// Without Commit nothing is changed and the prepared files are removed.
class StagedFolder {
 public:
  // Whether an entry of the folder, named relative to it ("a.bin", "truth/a.bin"), is a part of
  // what is being replaced: the old one goes, with all that is in it.
  using IsOwned = std::function<bool(std::string_view name)>;

  // Creates the parents of `target`. Throws InputError if it is a file or cannot be written.
  explicit StagedFolder(const std::filesystem::path& target);
  ~StagedFolder();
  StagedFolder(const StagedFolder&) = delete;
  StagedFolder& operator=(const StagedFolder&) = delete;

  // Where files are prepared, for those that write by themselves.
  const std::filesystem::path& path() const { return stage_; }

  // Adds a file; `name` may have folders. Throws InputError if it cannot be written.
  void Write(const std::string& name, const std::function<void(std::ostream*)>& write);

  // Puts the prepared files in place: those entries of the old folder that are owned are gone, all
  // others are kept. The folders change places in one step where the system can do it (Linux); else
  // file by file, and also if the folder cannot or should not be moved: a mount point, the current
  // folder of this program, one with entries of other users, other file systems or above
  // kMaxNumKept in number. What a killed program left of an earlier version is removed.
  void Commit(const IsOwned& owned);

  static constexpr size_t kMaxNumKept = 1000;

 private:
  bool CommitInOneStep(const IsOwned& owned);
  void RemoveLeftovers(const IsOwned& owned) const;

  std::filesystem::path target_;
  std::filesystem::path stage_;
  std::unique_ptr<TemporaryPath> temporary_;  // removes the stage if the program is interrupted
  std::unique_ptr<StageLock> lock_;
  bool inside_ = false;  // the stage is in the target, for want of rights beside it
};

}  // namespace holba
