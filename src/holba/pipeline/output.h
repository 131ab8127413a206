// SPDX-License-Identifier: BSD-3-Clause
// What is written beside a model for people to look at.
#pragma once

#include <filesystem>

#include "holba/pipeline/photograph_folder.h"
#include "holba/scene/reconstruction.h"

namespace holba {

// FOLDER/structure.ply: lines and groups; FOLDER/points.ply: points.
void WriteStructurePly(const Reconstruction& model, const std::filesystem::path& folder);

// FOLDER/pictures: for `num_pictures` images spread evenly over the model (-1: all) the photograph
// with its segments by vanishing point, its groups, its junctions; and the scene from above.
// Pictures of an earlier run are replaced as a whole.
void WritePictures(const Reconstruction& model, const PhotographFolder& image_path,
                   const std::filesystem::path& folder, int num_pictures, int num_threads);

}  // namespace holba
