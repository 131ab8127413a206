// SPDX-License-Identifier: BSD-3-Clause
#include "holba/io/files.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <random>
#include <utility>
#include <vector>

#include "holba/base/error.h"
#include "holba/base/file_faults.h"

namespace holba {
namespace fs = std::filesystem;

class StageLock {
 public:
  // Takes the lock, if no other program has it.
  explicit StageLock(const fs::path& path)
      : descriptor_(open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK)) {
    is_held_ = descriptor_ >= 0 && flock(descriptor_, LOCK_EX | LOCK_NB) == 0;
  }
  ~StageLock() {
    if (descriptor_ >= 0) close(descriptor_);
  }
  StageLock(const StageLock&) = delete;
  StageLock& operator=(const StageLock&) = delete;

  bool is_held() const { return is_held_; }

 private:
  int descriptor_;
  bool is_held_;
};

namespace {

// Stages are named .NAME.holba- and this many hexadecimal digits; the base is cut, so that a name
// as long as the system allows has a stage, too.
constexpr std::string_view kStageInfix = ".holba-";
constexpr size_t kNumDigits = 8;
constexpr size_t kMaxStemBytes = 200;
constexpr std::string_view kStageFolderInside = "model";

std::string StagePrefix(const std::string& stem) {
  return fmt::format(".{}{}", stem.substr(0, kMaxStemBytes), kStageInfix);
}

// A name in `folder` that nothing has yet.
fs::path UnusedName(const fs::path& folder, const std::string& stem) {
  std::random_device random;
  fs::path name;
  do {
    name = folder / fmt::format("{}{:0{}x}", StagePrefix(stem), random(), kNumDigits);
  } while (fs::exists(fs::symlink_status(name)));
  return name;
}

// Stages of `stem` in `folder` that no program works on: those of programs that were killed.
std::vector<fs::path> Leftovers(const fs::path& folder, const std::string& stem) {
  const std::string prefix = StagePrefix(stem);
  std::vector<fs::path> found;
  std::error_code error;
  for (fs::directory_iterator entry(folder, error), end; !error && entry != end;
       entry.increment(error)) {
    std::string name = entry->path().filename().string();
    if (!name.starts_with(prefix)) continue;
    if (name.ends_with(kRemovedSuffix)) name.resize(name.size() - kRemovedSuffix.size());
    name.erase(0, prefix.size());
    if (name.size() != kNumDigits ||
        name.find_first_not_of("0123456789abcdef") != std::string::npos) {
      continue;
    }
    if (StageLock(entry->path()).is_held()) found.push_back(entry->path());
  }
  return found;
}

void WriteTo(const fs::path& path, const fs::path& shown,
             const std::function<void(std::ostream*)>& write) {
  errno = 0;
  std::ofstream stream(path, std::ios::binary | std::ios::trunc);
  if (!stream) throw CannotBeWritten(shown, SystemFault());
  write(&stream);
  stream.close();
  if (!stream) throw CannotBeWritten(shown, "the disk may be full");
}

// Whether two folders changed places.
bool Exchange(const fs::path& a, const fs::path& b) {
#if defined(__linux__) && defined(RENAME_EXCHANGE)
  return renameat2(AT_FDCWD, a.c_str(), AT_FDCWD, b.c_str(), RENAME_EXCHANGE) == 0;
#else
  return false;
#endif
}

// Absolute, without links as far as it exists: a bare name has a parent, too.
fs::path CanonicalPath(const fs::path& path) {
  std::error_code error;
  fs::path canonical = fs::absolute(path, error);
  if (!error) canonical = fs::weakly_canonical(canonical, error);
  if (error) throw CannotBeWritten(path, error.message());
  return canonical;
}

bool HoldsCurrentFolder(const fs::path& folder) {
  std::error_code ignored;
  const fs::path current = fs::current_path(ignored);
  return std::mismatch(folder.begin(), folder.end(), current.begin(), current.end()).first ==
         folder.end();
}

}  // namespace

void WriteFileWhole(const fs::path& path, const std::function<void(std::ostream*)>& write) {
  std::error_code error;
  const fs::path target = CanonicalPath(path);
  if (fs::is_directory(target)) throw FileIsWanted(path);
  // A device or pipe is written to, not replaced.
  if (fs::exists(target) && !fs::is_regular_file(target)) return WriteTo(target, path, write);
  const fs::path parent = target.parent_path();
  fs::create_directories(parent, error);
  if (error) throw FolderCannotBeMade(parent, error.message());
  const std::string name = target.filename().string();
  const TemporaryPath temporary(UnusedName(parent, name));
  const fs::path& stage = temporary.path();
  try {
    { const std::ofstream made(stage, std::ios::binary); }
    const StageLock lock(stage);
    WriteTo(stage, path, write);
    fs::rename(stage, target, error);
    if (error) throw CannotBeWritten(path, error.message());
  } catch (...) {
    fs::remove(stage, error);
    throw;
  }
  for (const fs::path& leftover : Leftovers(parent, name)) fs::remove_all(leftover, error);
}

namespace {

// Makes a folder with a file in it, and removes both: what a writer will do in `folder`, or, where
// that does not exist, in the nearest folder above.
void TryFolder(const fs::path& folder, const fs::path& shown) {
  fs::path existing = folder;
  while (!fs::exists(fs::symlink_status(existing)) && existing.has_relative_path()) {
    existing = existing.parent_path();
  }
  if (!fs::is_directory(existing)) {
    throw CannotBeWritten(shown, fmt::format("'{}' is no folder", existing.string()));
  }
  std::error_code error;
  const TemporaryPath temporary(UnusedName(existing, "probe"));
  fs::create_directory(temporary.path(), error);
  if (error) {
    throw CannotBeWritten(
        shown, fmt::format("'{}' takes no new files: {}", existing.string(), error.message()));
  }
  WriteTo(temporary.path() / "file", shown, [](std::ostream* stream) { *stream << "probe"; });
}

// Throws InputError for a name that the system does not allow (too long), before it is used.
fs::file_status StatusOf(const fs::path& path, const fs::path& shown) {
  std::error_code error;
  const fs::file_status status = fs::status(path, error);
  if (status.type() == fs::file_type::none) {
    throw CannotBeWritten(shown, error.message());
  }
  return status;
}

}  // namespace

void ProbeFile(const fs::path& path) {
  const fs::path target = CanonicalPath(path);
  const fs::file_status status = StatusOf(target, path);
  if (fs::is_directory(status) || !target.has_filename()) throw FileIsWanted(path);
  if (fs::exists(status) && !fs::is_regular_file(status)) {
    if (access(target.c_str(), W_OK) == 0) return;
    throw CannotBeWritten(path, SystemFault());
  }
  TryFolder(target.parent_path(), path);
}

void ProbeFolder(const fs::path& path, const std::function<bool(std::string_view name)>& is_file) {
  fs::path target = CanonicalPath(path);
  if (!target.has_filename()) target = target.parent_path();
  const fs::file_status status = StatusOf(target, path);
  if (fs::exists(status) && !fs::is_directory(status)) {
    throw FolderIsWanted(path);
  }
  // The rights beside the folder are wanted, too, but it can do without (StagedFolder).
  TryFolder(target, path);
  if (!fs::exists(status)) return;
  for (const fs::directory_entry& entry : fs::directory_iterator(target)) {
    if (!entry.is_directory() || !is_file(entry.path().filename().string())) continue;
    throw InputError(entry.path(),
                     "a file of this name will be written, but it is a folder; remove it, or give "
                     "another output folder");
  }
}

StagedFolder::StagedFolder(const fs::path& target) {
  std::error_code error;
  target_ = CanonicalPath(target);
  if (!target_.has_filename()) target_ = target_.parent_path();
  const bool exists = fs::exists(target_);
  if (exists && !fs::is_directory(target_)) {
    throw FolderIsWanted(target);
  }
  const fs::path parent = target_.parent_path();
  fs::create_directories(parent, error);
  if (error) throw FolderCannotBeMade(parent, error.message());
  const auto make_stage = [&](const fs::path& folder, const std::string& stem) {
    stage_ = UnusedName(folder, stem);
    temporary_ = std::make_unique<TemporaryPath>(stage_);
    if (!fs::create_directory(stage_, error)) return false;
    lock_ = std::make_unique<StageLock>(stage_);
    return true;
  };
  if (make_stage(parent, target_.filename().string())) return;
  inside_ = exists;
  if (inside_ && make_stage(target_, std::string(kStageFolderInside))) return;
  throw CannotBeWritten(target, error.message());
}

StagedFolder::~StagedFolder() {
  std::error_code ignored;
  if (!stage_.empty()) fs::remove_all(stage_, ignored);
}

void StagedFolder::Write(const std::string& name, const std::function<void(std::ostream*)>& write) {
  const fs::path path = stage_ / name;
  std::error_code error;  // the file's own failure says what is wrong
  // Below the stage only: one that an interrupt has removed is not made again.
  fs::path folder = stage_;
  for (const fs::path& part : fs::path(name).parent_path()) {
    folder /= part;
    fs::create_directory(folder, error);
  }
  WriteTo(path, target_ / name, write);
}

namespace {

// What the old folder holds of others is linked into the new one before they change places, so that
// it is never missing: files as hard links, folders made anew around their files.
class KeptEntries {
 public:
  KeptEntries(const fs::path& old_folder, const fs::path& new_folder,
              const StagedFolder::IsOwned& owned)
      : old_(old_folder), new_(new_folder), owned_(owned) {}

  // False: something cannot be linked, and nothing is.
  bool Link() {
    struct stat old_stat {};
    if (stat(old_.c_str(), &old_stat) == 0) {
      device_ = old_stat.st_dev;
      if (LinkFolder("")) return true;
    }
    std::error_code ignored;
    for (auto path = made_.rbegin(); path != made_.rend(); ++path) fs::remove(*path, ignored);
    return false;
  }

 private:
  bool LinkFolder(const fs::path& folder) {
    std::error_code error;
    for (fs::directory_iterator entry(old_ / folder, error), end; entry != end;
         entry.increment(error)) {
      const fs::path name = folder / entry->path().filename();
      if (owned_(name.generic_string())) continue;
      if (!LinkEntry(name)) return false;
    }
    return !error;
  }

  bool LinkEntry(const fs::path& name) {
    const fs::path from = old_ / name, to = new_ / name;
    struct stat from_stat {};
    if (++count_ > StagedFolder::kMaxNumKept || lstat(from.c_str(), &from_stat) != 0 ||
        from_stat.st_dev != device_) {
      return false;
    }
    std::error_code error;
    if (S_ISREG(from_stat.st_mode)) {
      fs::create_hard_link(from, to, error);
    } else if (S_ISLNK(from_stat.st_mode)) {
      fs::copy_symlink(from, to, error);
    } else if (S_ISDIR(from_stat.st_mode) && from_stat.st_uid == geteuid()) {
      if (!fs::is_directory(to)) {
        fs::create_directory(to, from, error);  // with the permissions of the old one
        if (error) return false;
        made_.push_back(to);
      }
      if (!LinkFolder(name)) return false;
      fs::last_write_time(to, fs::last_write_time(from, error), error);
      return !error;
    } else {
      return false;
    }
    if (error) return false;
    made_.push_back(to);
    return true;
  }

  fs::path old_, new_;
  const StagedFolder::IsOwned& owned_;
  dev_t device_ = 0;
  size_t count_ = 0;
  std::vector<fs::path> made_;
};

// Moves the entries of `stage` into `target`, one rename each, and removes what of the old ones is
// owned and not replaced.
void ReplaceOneByOne(const fs::path& stage, const fs::path& target, const fs::path& folder,
                     const StagedFolder::IsOwned& owned) {
  std::error_code error;
  std::vector<fs::path> fresh;
  for (const fs::directory_entry& entry : fs::directory_iterator(stage / folder)) {
    fresh.push_back(entry.path().filename());
  }
  for (const fs::path& name : fresh) {
    const fs::path from = stage / folder / name, to = target / folder / name;
    const bool from_is_folder = fs::is_directory(from), to_is_folder = fs::is_directory(to);
    if (from_is_folder && to_is_folder && !owned((folder / name).generic_string())) {
      ReplaceOneByOne(stage, target, folder / name, owned);
      continue;
    }
    // A rename does not replace a folder, nor anything by one.
    if (fs::exists(to) && (from_is_folder || to_is_folder)) {
      if (Exchange(from, to)) continue;
      fs::remove_all(to, error);
    }
    fs::rename(from, to, error);
    if (error) throw CannotBeWritten(to, error.message());
  }
  std::vector<fs::path> stale;
  for (const fs::directory_entry& entry : fs::directory_iterator(target / folder)) {
    const fs::path name = entry.path().filename();
    if (owned((folder / name).generic_string()) &&
        std::find(fresh.begin(), fresh.end(), name) == fresh.end()) {
      stale.push_back(entry.path());
    }
  }
  for (const fs::path& path : stale) {
    fs::remove_all(path, error);
    if (error)
      throw InputError(path, fmt::format("this old file cannot be removed ({}); remove it by hand",
                                         error.message()));
  }
}

// Moves what `folder`, once the target, has of others and the target has not back into it, and
// removes the rest.
void RemoveOldFolder(const fs::path& folder, const fs::path& target,
                     const StagedFolder::IsOwned& owned) {
  std::error_code ignored;
  std::vector<fs::path> names;
  for (fs::directory_iterator entry(folder, ignored), end; !ignored && entry != end;
       entry.increment(ignored)) {
    names.push_back(entry->path().filename());
  }
  for (const fs::path& name : names) {
    // A file that WriteFileWhole had begun is nobody's.
    if (owned(name.string()) || name.string().find(kStageInfix) != std::string::npos ||
        fs::exists(fs::symlink_status(target / name, ignored)))
      continue;
    fs::rename(folder / name, target / name, ignored);
    if (ignored) return;  // not ours to remove
  }
  fs::remove_all(folder, ignored);
}

}  // namespace

void StagedFolder::Commit(const IsOwned& owned) {
  const HoldSignals hold;
  std::error_code error;
  if (!fs::exists(target_)) {
    fs::rename(stage_, target_, error);
    if (error) throw CannotBeWritten(target_, error.message());
  } else if (!CommitInOneStep(owned)) {
    ReplaceOneByOne(stage_, target_, "", owned);
    fs::remove_all(stage_, error);
  }
  stage_.clear();
  lock_.reset();
  RemoveLeftovers(owned);
}

bool StagedFolder::CommitInOneStep(const IsOwned& owned) {
  if (inside_ || HoldsCurrentFolder(target_)) return false;
  struct stat target_stat {};
  if (stat(target_.c_str(), &target_stat) != 0 || target_stat.st_uid != geteuid()) return false;
  if (!KeptEntries(target_, stage_, owned).Link()) return false;
  std::error_code error;
  fs::permissions(stage_, fs::status(target_).permissions(), error);
  // Where it cannot be done, the links are moved onto what they are of, which changes nothing.
  if (!Exchange(stage_, target_)) return false;
  RemoveOldFolder(stage_, target_, owned);
  return true;
}

void StagedFolder::RemoveLeftovers(const IsOwned& owned) const {
  for (const fs::path& leftover : Leftovers(target_.parent_path(), target_.filename().string())) {
    RemoveOldFolder(leftover, target_, owned);
  }
  std::error_code ignored;
  for (const fs::path& leftover : Leftovers(target_, std::string(kStageFolderInside))) {
    fs::remove_all(leftover, ignored);
  }
}

}  // namespace holba
