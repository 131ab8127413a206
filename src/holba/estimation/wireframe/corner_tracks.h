// SPDX-License-Identifier: BSD-3-Clause
// Points from corners: the corners of the images matched along epipolar lines under known poses,
// joined into tracks, triangulated, and added to the model with observations of their own. Corners
// lie where edges end, so, other than blobs, on the lines of a wireframe.
#pragma once

#include <cstddef>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "holba/base/options.h"
#include "holba/scene/image_features.h"
#include "holba/scene/reconstruction.h"

namespace holba {

struct CornerTrackOptions {
  // Each image is matched with those that share most points with it.
  int num_neighbours = 10;
  double max_epipolar_error_px = 2.0;  // in both images
  // Distance of descriptors: of the unit vectors, as COLMAP's 0.7 for SIFT.
  double max_descriptor_distance = 0.7;
  // To the second best corner on the epipolar line, in both images.
  double max_ratio = 0.8;
  int min_num_images = 3;
  double max_error_px = 2.0;
  double min_triangulation_angle_deg = 1.5;  // COLMAP's
  // A track this near to a junction in all images that they share is that junction.
  double max_junction_distance_px = 1.0;

  void Describe(OptionTable* table) const;
};

struct CornerTrackReport {
  size_t num_image_pairs = 0;  // matched
  size_t num_matches = 0;
  size_t num_tracks = 0;                  // of matched corners, in min_num_images or more
  std::vector<point3D_t> point3D_ids;     // added to the model, ascending
  size_t num_observations = 0;            // of them
  double median_error_px = 0.0;           // of them
  size_t num_in_junctions = 0;            // tracks that are a junction seen once more
  size_t num_junction_observations = 0;   // added to those, from images that did not see them meet
  std::map<std::string, size_t> dropped;  // images, tracks and observations, by reason
};

// Needs poses and, for the range of depths, points. Images without described corners take no part.
// `junction_ids`: points that TriangulateJunctions made. The points have no colour: their
// photographs are not known here.
CornerTrackReport TriangulateCorners(const CornerTrackOptions& options,
                                     const ImageFeatureMap& features, int num_threads,
                                     Reconstruction* model,
                                     std::span<const point3D_t> junction_ids = {});

}  // namespace holba
