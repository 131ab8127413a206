// SPDX-License-Identifier: BSD-3-Clause
#include "holba/io/files.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <fstream>
#include <random>
#include <vector>

#ifdef __linux__
#include <fcntl.h>
#endif

#include "holba/base/error.h"

namespace holba {
namespace fs = std::filesystem;
namespace {

// A name in `folder` that nothing has yet.
fs::path UnusedName(const fs::path& folder, const std::string& stem) {
  std::random_device random;
  fs::path name;
  do {
    name = folder / fmt::format(".{}.holba-{:08x}", stem, random());
  } while (fs::exists(fs::symlink_status(name)));
  return name;
}

void WriteTo(const fs::path& path, const fs::path& shown,
             const std::function<void(std::ostream*)>& write) {
  std::ofstream stream(path, std::ios::binary | std::ios::trunc);
  if (!stream)
    throw InputError(shown, "cannot be written: check that the folder may be written to");
  write(&stream);
  stream.close();
  if (!stream) throw InputError(shown, "cannot be written: the disk may be full");
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
  if (error) throw InputError(path, "cannot be written: " + error.message());
  return canonical;
}

bool HoldsCurrentFolder(const fs::path& folder) {
  std::error_code ignored;
  const fs::path current = fs::current_path(ignored);
  return std::mismatch(folder.begin(), folder.end(), current.begin(), current.end()).first ==
         folder.end();
}

}  // namespace

std::string ReadFileBytes(const fs::path& path) {
  std::error_code error;
  const fs::file_status status = fs::status(path, error);
  if (!fs::exists(status)) throw InputError(path, "there is no such file");
  if (!fs::is_regular_file(status)) throw InputError(path, "expected a file, found something else");
  std::ifstream stream(path, std::ios::binary);
  if (!stream) throw InputError(path, "cannot be opened for reading");
  std::string bytes;
  const uintmax_t size = fs::file_size(path, error);
  if (error) throw InputError(path, "cannot be read: " + error.message());
  bytes.resize(size);
  stream.read(bytes.data(), static_cast<std::streamsize>(size));
  if (static_cast<uintmax_t>(stream.gcount()) != size) throw InputError(path, "cannot be read");
  return bytes;
}

void WriteFileWhole(const fs::path& path, const std::function<void(std::ostream*)>& write) {
  std::error_code error;
  const fs::path target = CanonicalPath(path);
  if (fs::is_directory(target)) throw InputError(path, "expected a file to write, found a folder");
  // A device or pipe is written to, not replaced.
  if (fs::exists(target) && !fs::is_regular_file(target)) return WriteTo(target, path, write);
  fs::create_directories(target.parent_path(), error);
  if (error) {
    throw InputError(target.parent_path(), "the folder cannot be created: " + error.message());
  }
  const TemporaryPath temporary(UnusedName(target.parent_path(), target.filename().string()));
  const fs::path& stage = temporary.path();
  try {
    WriteTo(stage, path, write);
    fs::rename(stage, target, error);
    if (error) throw InputError(path, "cannot be written: " + error.message());
  } catch (...) {
    fs::remove(stage, error);
    throw;
  }
}

StagedFolder::StagedFolder(const fs::path& target) {
  std::error_code error;
  target_ = CanonicalPath(target);
  if (!target_.has_filename()) target_ = target_.parent_path();
  const bool exists = fs::exists(target_);
  if (exists && !fs::is_directory(target_)) {
    throw InputError(target, "expected a folder to write a model into, found a file");
  }
  const fs::path parent = target_.parent_path();
  fs::create_directories(parent, error);
  if (error) throw InputError(parent, "the folder cannot be created: " + error.message());
  stage_ = UnusedName(parent, target_.filename().string());
  temporary_ = std::make_unique<TemporaryPath>(stage_);
  if (fs::create_directory(stage_, error)) return;
  if (exists) {
    stage_ = UnusedName(target_, "model");
    temporary_ = std::make_unique<TemporaryPath>(stage_);
    inside_ = true;
    if (fs::create_directory(stage_, error)) return;
  }
  throw InputError(target, "cannot be written: " + error.message());
}

StagedFolder::~StagedFolder() {
  std::error_code ignored;
  if (!stage_.empty()) fs::remove_all(stage_, ignored);
}

void StagedFolder::Write(const std::string& name, const std::function<void(std::ostream*)>& write) {
  WriteTo(stage_ / name, target_ / name, write);
}

void StagedFolder::Commit(const std::function<bool(std::string_view)>& owned) {
  const HoldSignals hold;
  std::error_code error;
  if (!fs::exists(target_)) {
    fs::rename(stage_, target_, error);
    if (error) throw InputError(target_, "cannot be written: " + error.message());
    stage_.clear();
    return;
  }
  if (inside_ || HoldsCurrentFolder(target_)) return CommitFileByFile(owned);
  // What is not ours is linked into the new folder before the exchange, so that it is never
  // missing.
  std::vector<std::string> others;
  for (const fs::directory_entry& entry : fs::directory_iterator(target_)) {
    const std::string name = entry.path().filename().string();
    if (owned(name)) continue;
    if (fs::is_regular_file(entry.symlink_status())) {
      fs::create_hard_link(entry.path(), stage_ / name, error);
      if (!error) continue;
    }
    others.push_back(name);  // folders, links: moved after the exchange
  }
  fs::permissions(stage_, fs::status(target_).permissions(), error);
  if (!Exchange(stage_, target_)) {
    for (const fs::directory_entry& entry : fs::directory_iterator(stage_)) {
      if (!owned(entry.path().filename().string())) fs::remove(entry.path(), error);
    }
    return CommitFileByFile(owned);
  }
  for (const std::string& name : others) {
    fs::rename(stage_ / name, target_ / name, error);
    if (error) {
      const fs::path kept = stage_;
      temporary_->Keep();
      stage_.clear();
      throw InputError(target_,
                       fmt::format("the model is written, but '{}' could not be moved into the "
                                   "new folder ({}); it is in {}",
                                   name, error.message(), kept.string()));
    }
  }
  fs::remove_all(stage_, error);
  stage_.clear();
}

void StagedFolder::CommitFileByFile(const std::function<bool(std::string_view)>& owned) {
  std::error_code error;
  std::vector<std::string> fresh, stale;
  for (const fs::directory_entry& entry : fs::directory_iterator(stage_)) {
    fresh.push_back(entry.path().filename().string());
  }
  for (const fs::directory_entry& entry : fs::directory_iterator(target_)) {
    const std::string name = entry.path().filename().string();
    if (owned(name) && std::find(fresh.begin(), fresh.end(), name) == fresh.end()) {
      stale.push_back(name);
    }
  }
  for (const std::string& name : fresh) {
    fs::rename(stage_ / name, target_ / name, error);
    if (error) throw InputError(target_ / name, "cannot be written: " + error.message());
  }
  for (const std::string& name : stale) {
    fs::remove(target_ / name, error);
    if (error) throw InputError(target_ / name, "cannot be removed: " + error.message());
  }
}

}  // namespace holba
