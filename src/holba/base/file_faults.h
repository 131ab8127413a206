// SPDX-License-Identifier: BSD-3-Clause
// What can be wrong with any file, said in the same words everywhere, and how a file is read whole.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "holba/base/error.h"

namespace holba {

// "x.txt: there is no such file; check the path". `option`: "--image_path", said instead of "the
// path" where the path is that of an option.
InputError NoSuchFile(const std::filesystem::path& path);
InputError NoSuchFolder(const std::filesystem::path& path, std::string_view option = "the path");
InputError NoSuchFileOrFolder(const std::filesystem::path& path,
                              std::string_view option = "the path");
// `why`: the reason, as the system gives it: "Permission denied".
InputError CannotBeRead(const std::filesystem::path& path, std::string_view why);
InputError CannotBeWritten(const std::filesystem::path& path, std::string_view why);
InputError FolderCannotBeMade(const std::filesystem::path& path, std::string_view why);
InputError FileIsWanted(const std::filesystem::path& path);    // a folder is there
InputError FolderIsWanted(const std::filesystem::path& path);  // a file is there

// Throws InputError for text in UTF-16, which Windows' editors write.
void RefuseUtf16(std::string_view bytes, const std::filesystem::path& path);

// The system's words for `errno`, to be taken before anything else is called.
std::string SystemFault();

// All bytes of a regular file. Throws InputError.
std::string ReadFileBytes(const std::filesystem::path& path);

}  // namespace holba
