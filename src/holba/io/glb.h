// SPDX-License-Identifier: BSD-3-Clause
// Binary glTF 2.0 of a model for Blender, Windows' 3D viewer, web pages and game engines (Khronos,
// "glTF 2.0 Specification", 2021): points, lines by direction, translucent meshes of groups, and
// the cameras that a pinhole stands for.
#pragma once

#include <filesystem>
#include <ostream>

#include "holba/scene/reconstruction.h"

namespace holba {

// glTF's +y is up: the node "model" turns the scene so that it is (EstimateDown), and holds what
// the positions are relative to. Its children "points", "lines", "groups" and "cameras" have world
// coordinates but for that. Creates the parent folders. Throws InputError if the file cannot be
// written.
void WriteGlb(const Reconstruction& model, const std::filesystem::path& path);
void FormatGlb(const Reconstruction& model, std::ostream* stream);

}  // namespace holba
