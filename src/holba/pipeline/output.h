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

// The model from aside, from above and along its directions (scene_view.h), as PNG. `unit`: what a
// length of the model is called; empty: units. `prefix`: "", or "FOLDER/" in the stage.
void StageScenePictures(const Reconstruction& model, const std::string& unit, int num_threads,
                        const std::string& prefix, StagedFolder* stage);

enum class PictureFormat { kPng, kJpeg };
// For `num_pictures` images spread evenly over the model (-1: all) the photograph with its segments
// by vanishing point (NAME_lines), its groups (NAME_groups), its junctions (NAME_wireframe), and
// with the model through its lens over it (NAME_model). `without_photograph`: images that are
// passed over.
void StageImagePictures(const Reconstruction& model, const PhotographFolder& image_path,
                        const std::set<image_t>& without_photograph, int num_pictures,
                        PictureFormat format, int num_threads, const std::string& prefix,
                        StagedFolder* stage);

// pictures/: both of these, and the scene from above by its lines and planes (top_view.png).
void StagePictures(const Reconstruction& model, const PhotographFolder& image_path,
                   const std::set<image_t>& without_photograph, int num_pictures, int num_threads,
                   const std::string& prefix, StagedFolder* stage);

// What StageScenePictures writes, for the stage's Commit, and the folder for StageImagePictures
// beside it.
bool IsScenePicture(std::string_view name);
inline constexpr const char* kImagePictures = "view_images";

// The names of these, for the stage's Commit: pictures of an earlier run are replaced as a whole.
// (Until 0.1 they were prepared in a folder .pictures.new, which a killed run left.)
bool IsPly(std::string_view name);
bool IsPictureFolder(std::string_view name);

}  // namespace holba
