// SPDX-License-Identifier: BSD-3-Clause
// The correspondence graph of a database.
#pragma once

#include <cstddef>

#include "holba/io/database.h"
#include "holba/scene/correspondence_graph.h"

namespace holba {

// Which pairs of images a mapper trusts: COLMAP's rule and defaults.
struct MatchSelection {
  size_t min_num_matches = 15;     // verified ones (inliers); pairs without any never count
  bool ignore_watermarks = false;  // pairs whose matches were taken for a watermark
};

// Keypoints and verified matches of all images, by the database's ids. `features` and
// `line_matches` (may be null; by the same ids, of images of the database) add segments and their
// matches.
// Throws InputError for what is damaged, also for matches of an image without keypoints.
CorrespondenceGraph ReadCorrespondenceGraph(const Database& database,
                                            const MatchSelection& selection = {},
                                            const ImageFeatureMap* features = nullptr,
                                            const LineMatchMap* line_matches = nullptr);

}  // namespace holba
