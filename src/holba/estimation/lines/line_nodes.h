// SPDX-License-Identifier: BSD-3-Clause
// The 3D hypothesis of each segment and the segments of other images that agree with it: candidates
// by epipolar geometry (or given matches), proposals (line_proposals.h), scores (line_consensus.h).
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "holba/estimation/lines/line_options.h"
#include "holba/estimation/lines/line_scene.h"
#include "holba/scene/image_features.h"

namespace holba {

enum class ProposalKind : uint8_t {
  kRayPlane,       // the plane of a segment in another image
  kPoints,         // two or more shared points on both segments
  kPoint,          // one shared point and the other plane
  kDirection,      // a vanishing point and the other plane
  kScenePlane,     // a plane of the scene alone
  kDirectionDepth  // a vanishing point and a point's depth
};
inline constexpr int kNumProposalKinds = 6;
inline constexpr std::array<std::string_view, kNumProposalKinds> kProposalNames = {
    "ray_plane", "points", "point", "direction", "scene_plane", "direction_depth"};

struct SegmentKey {
  uint32_t view = 0, segment = 0;  // in LineScene
  friend auto operator<=>(const SegmentKey&, const SegmentKey&) = default;
};

struct SegmentNode {
  bool placed = false;  // has a hypothesis of enough score
  double score = 0.0;
  ProposalKind kind = ProposalKind::kRayPlane;
  // Plane of the best proposal of enough score that came from one (LineScene::planes), -1: none.
  int32_t plane = -1;
  Eigen::Vector3d start, end;        // of the hypothesis, on the rays of the segment's ends
  std::vector<SegmentKey> agreeing;  // segments of proposals of enough score, sorted
};

struct NodeCounts {
  size_t candidates = 0;
  std::array<size_t, kNumProposalKinds> proposals{};
  std::array<size_t, kNumProposalKinds> best{};  // of the placed segments
  std::map<std::string, size_t> dropped;
};

// nodes[view][segment]. `matches`: null: all pairs of neighbouring images.
std::vector<std::vector<SegmentNode>> PlaceSegments(const LineOptions& options,
                                                    const LineScene& scene,
                                                    const LineMatchMap* matches, int num_threads,
                                                    NodeCounts* counts);

}  // namespace holba
