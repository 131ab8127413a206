// SPDX-License-Identifier: BSD-3-Clause
// A database as a mapper wants it: a scene without poses, the graph of its matches, segments and
// vanishing points with theirs. What the database lacks of structure is found in the photographs,
// where they are at hand, and kept there.
#pragma once

#include <cstddef>
#include <filesystem>
#include <map>
#include <optional>
#include <set>
#include <string>

#include "holba/io/database.h"
#include "holba/io/database_graph.h"
#include "holba/pipeline/detection.h"
#include "holba/pipeline/match_segments.h"
#include "holba/scene/mapping_input.h"
#include "holba/scene/reconstruction.h"

namespace holba {

struct MappingDataOptions {
  MatchSelection selection;
  bool structure = true;  // segments, vanishing points and their matches
  int num_threads = -1;
};

struct MappingData {
  Reconstruction scene;  // all images without poses; ids are the database's
  MappingInput input;
  std::set<image_t> without_photograph;
  MatchSegmentsReport segments;
  size_t num_images_of_unknown_rigs = 0;
};

// `photographs`: null: the database's own structure only. Throws InputError.
MappingData ReadMappingData(const MappingDataOptions& options, const DetectionOptions& detection,
                            const LineMatchingOptions& matching,
                            const std::filesystem::path* photographs, Database* database);

}  // namespace holba
