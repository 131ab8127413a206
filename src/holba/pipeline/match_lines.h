// SPDX-License-Identifier: BSD-3-Clause
// Matches of segments of pairs of images that share points: imported, taken from the database, or
// made and kept there.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "holba/base/options.h"
#include "holba/frontend/importers/import_segments.h"
#include "holba/frontend/matching/line_matching.h"
#include "holba/io/database.h"
#include "holba/pipeline/image_pairs.h"
#include "holba/scene/image_features.h"
#include "holba/scene/reconstruction.h"

namespace holba {

struct MatchLinesOptions {
  LineMatchingOptions matching;
  ImagePairOptions pairs;
  int num_threads = -1;

  void Describe(OptionTable* table) const;
};

struct MatchLinesReport {
  size_t num_pairs = 0, pairs_reused = 0;  // reused: was in the database
  bool matches_imported = false;
  size_t num_line_matches = 0;
  std::map<std::string, size_t> dropped;  // of an import
  double match_seconds = 0.0;
};

// `database_id`: Database::MatchImages. `import_path`: file of matches of the segments `imported`,
// used instead of ours; empty: none. Pairs whose segments have no descriptors, which another
// program brought, have the matches that the database has of them.
LineMatchMap MatchLines(const MatchLinesOptions& options, const std::string& import_path,
                        const Reconstruction& model, const ImageFeatureMap& features,
                        const std::map<image_t, image_t>& database_id,
                        const std::map<image_t, ImportedSegments>& imported, Database* database,
                        MatchLinesReport* report);

// What the database has of a pair, whoever made it; empty: nothing.
std::vector<LineMatch> StoredLineMatches(const Database& database, image_t image_id1,
                                         image_t image_id2);

// One line, for the log.
std::string MatchingText(const MatchLinesReport& report);

}  // namespace holba
