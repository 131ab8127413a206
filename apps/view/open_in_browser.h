// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>

namespace holba {

// A file model.html in a new folder for temporary files, which only this user can write to. Throws
// InputError.
std::filesystem::path TemporaryPage();

// Asks the system to show a file (and waits for what asks, not for the browser). False: there is no
// screen, or nothing to ask.
bool OpenInBrowser(const std::filesystem::path& path);

}  // namespace holba
