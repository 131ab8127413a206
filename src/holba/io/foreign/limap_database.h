// SPDX-License-Identifier: BSD-3-Clause
// LIMAP 2.0's SQLite database (structure_database.db beside COLMAP's database.db): 2D lines, groups
// and edges of images, matches of lines and of groups. Images are known by the ids of COLMAP's
// database. Tables: structure2d(image_id, data), line_matches and group_matches(pair_id, rows,
// cols = 2, data: uint32 row by row), pair_id = 2147483647 * smaller id + greater id, meta.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <ostream>
#include <utility>
#include <vector>

#include "holba/io/database.h"
#include "holba/io/foreign/limap.h"
#include "holba/scene/reconstruction.h"

namespace holba {

struct LimapDatabase {
  // Indices in the image with the smaller id, in the other one.
  using Matches = std::vector<std::pair<uint32_t, uint32_t>>;

  std::map<image_t, LimapStructure2d> structures;
  std::map<ImagePair, Matches> line_matches, group_matches;
};

bool IsSqliteFile(const std::filesystem::path& path);
// Whether a file is an SQLite database with LIMAP's table of structures.
bool IsLimapDatabase(const std::filesystem::path& path);
// Throws InputError for a file that is damaged.
LimapDatabase ReadLimapDatabase(const std::filesystem::path& path);
// The bytes of its file; as a whole file. Throws InputError if it cannot be written.
void FormatLimapDatabase(const LimapDatabase& limap, std::ostream* stream);
void WriteLimapDatabase(const LimapDatabase& limap, const std::filesystem::path& path);

// A model's 2D features, all groups of types that LIMAP has (DeleteTypesUnknownToLimap); segments
// (groups) of one 3D line (group) are matches. 2D groups have the parameters that their 3D group
// gives them in the image.
LimapDatabase LimapDatabaseOf(const Reconstruction& model);
// What is in a COLMAP database's tables of ours: segments, vanishing points, matches of segments.
LimapDatabase LimapDatabaseOf(const Database& database);
// The inverse: adds segments, vanishing points and matches of segments to a COLMAP database whose
// images these are. Throws InputError if it lacks one of them. Returns how many images.
size_t AddToDatabase(const LimapDatabase& limap, const std::filesystem::path& path,
                     Database* database);

// The images of COLMAP's database.db in the same folder with its keypoints, LIMAP's lines and
// groups, and without poses. Throws InputError if there is none.
Reconstruction ReadLimapDatabaseAsModel(const std::filesystem::path& path);

}  // namespace holba
