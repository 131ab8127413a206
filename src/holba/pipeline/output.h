// SPDX-License-Identifier: BSD-3-Clause
// What is written beside a model for people to look at.
#pragma once

#include <filesystem>
#include <set>
#include <string>
#include <string_view>

#include "holba/io/files.h"
#include "holba/pipeline/photograph_folder.h"
#include "holba/scene/reconstruction.h"

namespace holba {

// structure.ply: lines and groups; points.ply: points. `prefix`: "", or "FOLDER/" in the stage.
void StageStructurePly(const Reconstruction& model, const std::string& prefix, StagedFolder* stage);

// pictures/: for `num_pictures` images spread evenly over the model (-1: all) the photograph
// with its segments by vanishing point, its groups, its junctions; and the scene from above.
// `without_photograph`: images that are passed over.
void StagePictures(const Reconstruction& model, const PhotographFolder& image_path,
                   const std::set<image_t>& without_photograph, int num_pictures, int num_threads,
                   const std::string& prefix, StagedFolder* stage);

// The names of these, for the stage's Commit: pictures of an earlier run are replaced as a whole.
// (Until 0.1 they were prepared in a folder .pictures.new, which a killed run left.)
bool IsPly(std::string_view name);
bool IsPictureFolder(std::string_view name);

}  // namespace holba
