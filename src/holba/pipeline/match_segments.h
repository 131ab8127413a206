// SPDX-License-Identifier: BSD-3-Clause
// Matches of the segments of a database's images without poses: by descriptor, and by the verified
// matches of points around the segments, which tell repeated edges apart. Kept in our table of line
// matches as candidates, the nearest first; MutualNearest (line_matching.h) has the ones that are
// mostly right.
#pragma once

#include <vector>

#include "holba/base/options.h"
#include "holba/frontend/matching/line_matching.h"
#include "holba/io/database.h"

namespace holba {

// MutualNearest's ratio at which 98 % of matches on facades were right.
inline constexpr double kMaxLineMatchRatio = 0.9;

// Where few points are matched, as on walls, the nearest ones say where a segment is.
inline constexpr int kNearPointsWithoutPoses = 3;

struct MatchSegmentsReport {
  size_t num_pairs = 0, pairs_reused = 0;  // of images with segments; reused: was in the database
  size_t num_matches = 0, num_mutual = 0;  // candidates; of these the mutual nearest
  double seconds = 0.0;
};

// Of those pairs that are verified. Where both focal lengths are known the essential matrix says
// which segments can match, else the fundamental matrix: a pair whose fundamental matrix has more
// inliers than the calibration allows has mostly gained them by chance. Nothing is done where no
// image has described segments. `found` (null: not wanted) gets the mutual nearest ones.
MatchSegmentsReport MatchSegmentsOfPairs(const LineMatchingOptions& options,
                                         const std::vector<ImagePair>& pairs, int num_threads,
                                         Database* database, LineMatchMap* found = nullptr);

}  // namespace holba
