// SPDX-License-Identifier: BSD-3-Clause
// nerfstudio's transforms.json (Tancik et al. 2023; also instant-ngp's): cameras, for each frame
// the matrix of camera to world with OpenGL's axes (x right, y up, z backwards) and the path of the
// photograph; pixels are COLMAP's. The points lie in a PLY file that it names.
#pragma once

#include <filesystem>
#include <ostream>
#include <string_view>

#include "holba/io/files.h"
#include "holba/scene/reconstruction.h"

namespace holba {

// transforms.json and, of a model with points, sparse_pc.ply in a folder, in the frame of the
// model. Paths of photographs are images/NAME. Lines and groups are left out, images without a
// pose, too. Throws InputError for cameras that nerfstudio does not have.
void WriteNerfstudio(const Reconstruction& model, const std::filesystem::path& folder);
// Whether WriteNerfstudio could write there.
void ProbeNerfstudio(const std::filesystem::path& folder);
void FormatTransforms(const Reconstruction& model, std::ostream* stream);

}  // namespace holba
