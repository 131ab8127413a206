// SPDX-License-Identifier: BSD-3-Clause
// Models as folders: a COLMAP sparse model and our files beside it (FORMAT.md), or LIMAP's; and
// models of other programs (io/foreign), wherever a model is read.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

#include "holba/base/options.h"
#include "holba/io/files.h"
#include "holba/io/model_format.h"
#include "holba/scene/reconstruction.h"

namespace holba {

// The format of the COLMAP files in a folder, binary if cameras, images and points3D are there as
// binary. Empty: neither format is complete, the folder is no model.
std::optional<ModelFormat> FindModelFormat(const std::filesystem::path& folder);

// Whether a folder has a file of images, or a model of another program: what ReadPoses needs.
bool HoldsPoses(const std::filesystem::path& folder);

struct ReadModelOptions {
  bool strict = false;

  void Describe(OptionTable* table) const;
};

// A folder or a file: a COLMAP model with our files or LIMAP's, a file of another program or a
// folder that holds one (foreign_model.h), or a BAL problem, which any other file is taken for.
// COLMAP's and ours: binary first, as COLMAP does; of our files each that is there. The model is
// consistent: links between 2D and 3D features that one end only knows are dropped with one warning
// (strict: refused with the list of them). Throws InputError with file and place, also if two
// images have one name, or if the poses are not those that our files belong to.
Reconstruction ReadModel(const std::filesystem::path& path, const ReadModelOptions& options = {});

// Whether ReadModel takes the path for a BAL problem.
bool IsReadAsBal(const std::filesystem::path& path);

// The model, or what there is of one: of a folder without points3D the poses and what the images
// see, without cameras also those by their ids alone. For what asks for poses only.
Reconstruction ReadPoses(const std::filesystem::path& folder);

// Creates the folder with its parents. Either what was there or the whole new model is there, never
// a mix; model files of the other format are removed, files that are no model files stay. Our files
// are written only if the model holds lines, groups, edges or relations; rigs and frames only if it
// came with them. Throws InputError if it cannot be written; the model must be consistent.
void WriteModel(const Reconstruction& model, const std::filesystem::path& folder,
                ModelFormat format);

// The same in two steps, for a folder that holds more than one model, or other things that belong
// to it: adds the model's files to `stage` (`prefix`: "", or "FOLDER/" in it), whose Commit must
// claim the names that IsModelFile says.
void StageModel(const Reconstruction& model, ModelFormat format, const std::string& prefix,
                StagedFolder* stage);
bool IsModelFile(std::string_view name);

// Whether WriteModel could write there, found out before there is a model. Throws InputError.
void ProbeModelFolder(const std::filesystem::path& folder);

}  // namespace holba
