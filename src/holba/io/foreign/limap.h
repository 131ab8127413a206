// SPDX-License-Identifier: BSD-3-Clause
// LIMAP 2.0's models: a COLMAP model with a folder `structures` of four files (structures2d,
// lines3D, groups3D, wireframe3D) beside it, and the database that its programs keep 2D features
// and matches in (limap_database.h). Layout: little-endian binary, or text of words in the same
// order.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string_view>
#include <utility>
#include <vector>

#include "holba/io/files.h"
#include "holba/scene/reconstruction.h"

namespace holba {

// Whether LIMAP would find structure there: all four files as binary, or as text.
bool HoldsLimapStructures(const std::filesystem::path& folder);

// Adds what is in the files of `structures` to the model of the same folder, whose images, points
// and keypoints are there. What cannot be ours is left out and counted in a warning: lines without
// extent, groups whose parameters are none, edges and members of what is not in the model. Weights,
// scores and uncertainties have no place here. Throws InputError; links that one end only knows
// are left to the caller.
void ReadLimapStructures(const std::filesystem::path& folder, Reconstruction* model);

// Deletes the groups, in 3D and in the images, of types that LIMAP lacks. Returns how many in 3D.
size_t DeleteTypesUnknownToLimap(Reconstruction* model);

// The model in LIMAP's form, binary: its reader of text refuses its own files. Not held by it are
// relations, colours of lines and groups that its types lack. With structure_database.db, in which
// segments of one line are matches.
void WriteLimap(const Reconstruction& model, const std::filesystem::path& folder);
void ProbeLimap(const std::filesystem::path& folder);

// A name in a model's folder, "structures/lines3D.bin".
bool IsLimapFile(std::string_view name);

// One image's structure as LIMAP has it.
struct LimapStructure2d {
  struct Edge {
    point2D_t point2D_idx = 0;
    line2D_t line2D_idx = 0;
    double weight = 0.0;
  };
  uint64_t num_points = 0;
  std::vector<Line2D> lines;
  std::vector<Group2D> groups;
  std::vector<std::vector<double>> group_params;  // in the database only
  std::vector<Edge> edges;
};

// What an image of a model sees: with the edges of the wireframe whose two ends it observes.
LimapStructure2d LimapStructureOf(const Reconstruction& model, image_t image_id);

}  // namespace holba
