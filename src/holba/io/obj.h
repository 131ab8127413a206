// SPDX-License-Identifier: BSD-3-Clause
// Wavefront OBJ of a model's lines and groups, as text: lines as elements "l" in one object for
// each direction, groups as meshes of "f". World frame, model units.
#pragma once

#include <filesystem>
#include <ostream>

#include "holba/scene/reconstruction.h"

namespace holba {

// Creates the parent folders. Throws InputError if the file cannot be written.
void WriteObj(const Reconstruction& model, const std::filesystem::path& path);
void FormatObj(const Reconstruction& model, std::ostream* stream);

}  // namespace holba
