// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <string>

namespace holba {

// A file NAME.html in a new folder for temporary files, which only this user can write to. Throws
// InputError.
std::filesystem::path TemporaryPage(const std::string& name);

// Asks the system to show a file and does not wait. False: there is no screen, or nothing to ask.
bool OpenInBrowser(const std::filesystem::path& path);

}  // namespace holba
