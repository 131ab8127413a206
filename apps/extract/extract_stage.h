// SPDX-License-Identifier: BSD-3-Clause
// From photographs to a database, with what is said of it on the way, for the commands extract and
// reconstruct.
#pragma once

#include <filesystem>

#include "holba/pipeline/extract.h"

namespace holba {

// Throws InputError.
ExtractReport RunExtract(const ExtractOptions& options, const std::filesystem::path& image_path,
                         const std::filesystem::path& database_path);

}  // namespace holba
