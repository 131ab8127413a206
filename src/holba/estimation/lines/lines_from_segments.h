// SPDX-License-Identifier: BSD-3-Clause
// 3D lines of a posed model from the segments of its images: candidates by epipolar geometry,
// proposals from points, vanishing points and planes, consensus, tracks, robust refinement
// (Liu et al., "3D line mapping revisited", 2023, with single-view proposals and fits held to
// groups).
#pragma once

#include <array>
#include <map>
#include <string>

#include "holba/estimation/lines/line_nodes.h"
#include "holba/estimation/lines/line_options.h"
#include "holba/scene/image_features.h"
#include "holba/scene/reconstruction.h"

namespace holba {

struct LineReport {
  size_t num_segments = 0;  // of all images
  size_t num_usable_segments = 0;
  double mean_neighbours = 0.0;  // of an image
  size_t num_candidates = 0;     // pairs of segments
  // By ProposalKind (kProposalNames): made, and those that won their segment.
  std::array<size_t, kNumProposalKinds> proposals{}, best_proposals{};
  size_t num_placed_segments = 0;
  size_t num_tracks = 0;  // before refinement
  size_t num_merged = 0, num_claimed = 0;
  size_t num_held_to_direction = 0, num_held_to_plane = 0;
  size_t num_lines = 0;  // with min_images or more
  size_t num_lines_with_4_images = 0;
  // Reliable: sigma of both ends below max_relative_sigma of the depth, from pixels alone.
  size_t num_reliable = 0, num_reliable_with_4_images = 0;
  size_t num_observations = 0;
  double median_error_px = 0.0;  // of the lines' errors
  // How many segments, candidates, pairs or lines ended for each reason ("what: why").
  std::map<std::string, size_t> dropped;
  // The group that a line was held to in its fit (it agrees with it in pixels).
  std::map<line3D_t, group3D_t> vp_of_line, plane_of_line;
  double seconds_candidates = 0.0, seconds_tracks = 0.0;
};

// Needs poses and points (for neighbours and depths); VP and PLANE groups that are there propose
// lines. Sets every image's lines2D to the segments of its features (same indices), removes lines
// that were there (also from groups and the wireframe), adds the new ones with ids from 1, track,
// extent and error; members of groups are not set. `matches` null: segments of all pairs of
// neighbours may match.
LineReport BuildLines(const LineOptions& options, const ImageFeatureMap& features,
                      const LineMatchMap* matches, int num_threads, Reconstruction* model);

}  // namespace holba
