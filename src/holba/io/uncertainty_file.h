// SPDX-License-Identifier: BSD-3-Clause
// covariances.txt: the covariances of a model's elements, one record per line after '#' comments
// that name the fields; matrices as their upper triangles, row by row.
#pragma once

#include <filesystem>
#include <ostream>

#include "holba/scene/uncertainty.h"

namespace holba {

// Creates the parent folders. Throws InputError if it cannot be written.
void WriteUncertainty(const ModelUncertainty& uncertainty, const std::filesystem::path& path);
void FormatUncertainty(const ModelUncertainty& uncertainty, std::ostream* stream);

}  // namespace holba
