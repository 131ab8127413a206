// SPDX-License-Identifier: BSD-3-Clause
#include "holba/base/file_faults.h"

#include <fmt/format.h>

#include <cerrno>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <system_error>

namespace holba {
namespace fs = std::filesystem;

InputError NoSuchFile(const fs::path& path) {
  return InputError(path, "there is no such file; check the path");
}

InputError NoSuchFolder(const fs::path& path, std::string_view option) {
  return InputError(path, fmt::format("there is no such folder; check {}", option));
}

InputError NoSuchFileOrFolder(const fs::path& path, std::string_view option) {
  return InputError(path, fmt::format("there is no such file or folder; check {}", option));
}

InputError CannotBeRead(const fs::path& path, std::string_view why) {
  return InputError(
      path, fmt::format("cannot be read ({}); check its permissions and the disk it is on", why));
}

InputError CannotBeWritten(const fs::path& path, std::string_view why) {
  return InputError(path, fmt::format("cannot be written ({}); give another place, or check the "
                                      "permissions of the folder and the space on its disk",
                                      why));
}

InputError FolderCannotBeMade(const fs::path& path, std::string_view why) {
  return InputError(path, fmt::format("the folder cannot be made ({}); give another place, or "
                                      "check the permissions of the folder above it",
                                      why));
}

InputError FileIsWanted(const fs::path& path) {
  return InputError(path, "expected a file, found a folder or device; give the path of a file");
}

InputError FolderIsWanted(const fs::path& path) {
  return InputError(path, "expected a folder, found a file; give the path of a folder");
}

void RefuseUtf16(std::string_view bytes, const fs::path& path) {
  if (bytes.starts_with("\xFF\xFE") || bytes.starts_with("\xFE\xFF"))
    throw InputError(path, "expected text in ASCII or UTF-8, found UTF-16; save it as UTF-8");
}

std::string SystemFault() { return std::generic_category().message(errno); }

std::string ReadFileBytes(const fs::path& path) {
  std::error_code error;
  const fs::file_status status = fs::status(path, error);
  if (!fs::exists(status)) throw NoSuchFile(path);
  if (!fs::is_regular_file(status)) throw FileIsWanted(path);
  errno = 0;
  std::ifstream stream(path, std::ios::binary);
  if (!stream) throw CannotBeRead(path, SystemFault());
  std::string bytes;
  const uintmax_t size = fs::file_size(path, error);
  if (error) throw CannotBeRead(path, error.message());
  bytes.resize(size);
  errno = 0;
  stream.read(bytes.data(), static_cast<std::streamsize>(size));
  if (static_cast<uintmax_t>(stream.gcount()) != size) throw CannotBeRead(path, SystemFault());
  return bytes;
}

}  // namespace holba
