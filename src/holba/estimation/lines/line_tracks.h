// SPDX-License-Identifier: BSD-3-Clause
// Tracks: segments of several images that are one 3D line, from the hypotheses of single segments,
// and their refinement.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "holba/estimation/lines/line_fit.h"
#include "holba/estimation/lines/line_nodes.h"
#include "holba/estimation/lines/line_options.h"
#include "holba/estimation/lines/line_scene.h"

namespace holba {

struct LineTrack {
  std::vector<SegmentKey> members;  // sorted
  AnchoredLine line;                // directed as its segments, point amid the extent
  double t_start = 0.0, t_end = 0.0;
  double rms_px = 0.0;
  int32_t direction = -1;  // in LineScene::directions, if it is held to one
  int32_t plane = -1;      // in LineScene::planes, if it is held to one
  int32_t proposed_plane = -1;
  double score = 0.0;   // of the best hypothesis of a member
  bool changed = true;  // since its last fit

  Eigen::Vector3d Start() const { return line.At(t_start); }
  Eigen::Vector3d End() const { return line.At(t_end); }
};

// Distinct images of sorted members.
size_t NumImages(const std::vector<SegmentKey>& members);

struct TrackCounts {
  size_t merged = 0, claimed = 0, held_to_direction = 0, held_to_plane = 0;
  std::map<std::string, size_t> dropped;
};

// Joins segments whose hypotheses agree.
std::vector<LineTrack> JoinSegments(const LineOptions& options, const LineScene& scene,
                                    const std::vector<std::vector<SegmentNode>>& nodes,
                                    TrackCounts* counts);

// Fits, drops what does not fit, merges, claims; removes tracks with too few images.
void RefineTracks(const LineOptions& options, const LineScene& scene, int num_threads,
                  std::vector<LineTrack>* tracks, TrackCounts* counts);

}  // namespace holba
