// SPDX-License-Identifier: BSD-3-Clause
// DXF of a model for CAD programs, as text of release 12, which all of them open (Autodesk, "DXF
// Reference", AC1009): lines as LINE, one layer for each direction; groups as 3DFACE, one layer for
// each.
#pragma once

#include <filesystem>
#include <ostream>

#include "holba/scene/reconstruction.h"

namespace holba {

// Model units. Turned about the origin as CAD programs have it: z is up (EstimateDown), x the level
// direction of most lines. Creates the parent folders. Throws InputError if the file cannot be
// written.
void WriteDxf(const Reconstruction& model, const std::filesystem::path& path);
void FormatDxf(const Reconstruction& model, std::ostream* stream);

}  // namespace holba
