// SPDX-License-Identifier: BSD-3-Clause
// Binary PLY of a model for viewers (MeshLab, CloudCompare): points as coloured vertices, lines as
// coloured edges, groups as meshes of their extent, one colour for each group. World frame, model
// units.
#pragma once

#include <filesystem>
#include <ostream>

#include "holba/scene/reconstruction.h"

namespace holba {

// What goes into the file; viewers that draw either points or faces are served by a file of each.
struct PlyContent {
  bool points = true;
  bool lines = true;
  bool groups = true;
};

// Creates the parent folders. Throws InputError if the file cannot be written.
void WritePly(const Reconstruction& model, const std::filesystem::path& path,
              const PlyContent& content = {});
void FormatPly(const Reconstruction& model, const PlyContent& content, std::ostream* stream);

}  // namespace holba
