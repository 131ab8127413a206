// SPDX-License-Identifier: BSD-3-Clause
#include "apps/map/snapshot.h"

#include <fmt/format.h>

#include <cstring>
#include <sstream>
#include <system_error>
#include <utility>

#include "holba/base/error.h"
#include "holba/base/file_faults.h"
#include "holba/base/log.h"
#include "holba/io/files.h"
#include "holba/pipeline/settings.h"

namespace holba {
namespace fs = std::filesystem;
namespace {

// The version counts up with each change of what a state holds.
constexpr std::string_view kMagic = "holba mapping snapshot 1\n";

fs::path SnapshotPath(const fs::path& output_path) {
  std::error_code ignored;
  fs::path target = fs::weakly_canonical(fs::absolute(output_path, ignored), ignored);
  if (!target.has_filename()) target = target.parent_path();
  return target.parent_path() / fmt::format(".{}.holba-snapshot", target.filename().string());
}

void PutNumber(uint64_t number, std::string* bytes) {
  bytes->append(reinterpret_cast<const char*>(&number), sizeof(number));
}

// Takes from the front; false: there is too little.
bool TakeNumber(std::string_view* bytes, uint64_t* number) {
  if (bytes->size() < sizeof(*number)) return false;
  std::memcpy(number, bytes->data(), sizeof(*number));
  bytes->remove_prefix(sizeof(*number));
  return true;
}

// The first line that differs, as "--name was 1 and is 2 now".
std::string FirstDifference(const std::string& before, const std::string& now) {
  std::istringstream old_lines(before), new_lines(now);
  std::string a, b;
  while (std::getline(old_lines, a) && std::getline(new_lines, b)) {
    if (a == b) continue;
    const size_t cut = a.find('='), new_cut = b.find('=');
    if (a.substr(0, cut) != b.substr(0, new_cut)) break;
    return fmt::format("--{} was '{}' and is '{}' now", a.substr(0, cut), a.substr(cut + 1),
                       b.substr(new_cut + 1));
  }
  return "they are those of another version";
}

}  // namespace

SnapshotFile::SnapshotFile(const fs::path& output_path, std::string options, uint64_t fingerprint)
    : path_(SnapshotPath(output_path)), options_(std::move(options)), fingerprint_(fingerprint) {}

bool SnapshotFile::Exists() const { return fs::exists(path_); }

std::optional<std::string> SnapshotFile::Read() const {
  if (!Exists()) return std::nullopt;
  const std::string file = ReadFileBytes(path_);
  std::string_view bytes = file;
  uint64_t hash = 0, fingerprint = 0, options_size = 0;
  if (!bytes.starts_with(kMagic)) return std::nullopt;
  bytes.remove_prefix(kMagic.size());
  if (!TakeNumber(&bytes, &hash) || hash != HashBytes(bytes.data(), bytes.size()) ||
      !TakeNumber(&bytes, &fingerprint) || !TakeNumber(&bytes, &options_size) ||
      options_size > bytes.size())
    return std::nullopt;
  const std::string options(bytes.substr(0, options_size));
  bytes.remove_prefix(options_size);
  if (options != options_) {
    throw InputError(path_,
                     fmt::format("the run that is to be resumed had other options ({}); give "
                                 "the same ones, or --resume 0 to begin anew",
                                 FirstDifference(options, options_)));
  }
  if (fingerprint != fingerprint_) {
    throw InputError(path_,
                     "the run that is to be resumed had other images or matches; give its "
                     "--database_path, or --resume 0 to begin anew");
  }
  return std::string(bytes);
}

void SnapshotFile::Write(const std::string& state) {
  std::string content;
  PutNumber(fingerprint_, &content);
  PutNumber(options_.size(), &content);
  content += options_ + state;
  std::string head(kMagic);
  PutNumber(HashBytes(content.data(), content.size()), &head);
  try {
    WriteFileWhole(path_, [&](std::ostream* stream) { *stream << head << content; });
  } catch (const InputError& error) {
    if (!std::exchange(has_failed_, true))
      LogWarning("There are no snapshots to resume from: {}", error.what());
  }
}

void SnapshotFile::Remove() const {
  std::error_code ignored;
  fs::remove(path_, ignored);
}

}  // namespace holba
