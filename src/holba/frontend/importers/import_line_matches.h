// SPDX-License-Identifier: BSD-3-Clause
// Matches of line segments that other matchers wrote: as text, npz or HDF5 (docs: Importing
// features). Indices count the segments of the files that ImportSegments read.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "holba/frontend/importers/import_segments.h"
#include "holba/scene/image_features.h"
#include "holba/scene/reconstruction.h"

namespace holba {

struct LineMatchImportReport {
  size_t num_pairs = 0;
  size_t num_matches = 0;
  size_t num_unknown_pairs = 0;           // with a name that is no image of the model
  std::map<std::string, size_t> dropped;  // matches, by reason
};

// `path`: a text file (.txt), an archive (.npz), HDF5 (.h5), or a folder of them. Throws
// InputError: not readable, indices that the imported segments do not have, no pair of the model.
LineMatchMap ImportLineMatches(const std::filesystem::path& path, const Reconstruction& model,
                               const std::map<image_t, ImportedSegments>& segments,
                               LineMatchImportReport* report);

// One pair as a file has it.
struct RawLineMatches {
  std::string pair;  // "NAME1 NAME2" of text, else the path in the file
  bool is_text = false;
  std::vector<LineMatch> matches;  // indices of the file
  std::string place;               // for messages
};
std::vector<RawLineMatches> ParseLineMatchText(std::string_view bytes,
                                               const std::filesystem::path& path);

}  // namespace holba
