// SPDX-License-Identifier: BSD-3-Clause
// A synthetic set of photographs as a COLMAP database: cameras, images, keypoints, raw and verified
// matches with their two-view geometries, and in our tables segments, their matches, vanishing
// points and label maps. There are no descriptors.
#pragma once

#include <cstddef>
#include <string_view>

#include "holba/io/database.h"
#include "holba/scene/two_view_geometry.h"
#include "holba/synthetic/photo_set.h"

namespace holba {

// Where two-view geometries come from. kTruth: the true one fitted to the pair's verified matches,
// which stay as they are; kEstimated: found by EstimateTwoView (estimation/two_view) in the raw
// matches, as `holba match` does it: the inliers are then what it takes for right.
enum class GeometrySource { kTruth, kEstimated };

// The settings of all rows of our tables.
inline constexpr std::string_view kSyntheticSettings = "synthetic 1";

struct PhotoDatabaseReport {
  size_t num_pairs = 0;    // with a geometry
  size_t num_inliers = 0;  // matches of these
  size_t num_planar = 0;   // of the pairs: planar or panoramic
};

// Of one pair of the set.
TwoViewGeometry GeometryOf(const PhotoSet& set, const PhotoSetPair& pair, GeometrySource source);

// Into a database without images; in one transaction. Throws InputError.
PhotoDatabaseReport WritePhotoDatabase(const PhotoSet& set, GeometrySource source, int num_threads,
                                       Database* database);

}  // namespace holba
