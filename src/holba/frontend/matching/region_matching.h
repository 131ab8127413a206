// SPDX-License-Identifier: BSD-3-Clause
// Which regions of two images are one surface: by votes of matched features, or by warping one
// image's regions into the other through a field of correspondences (the paper, appendix
// "Cross-Image Group Matching").
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "holba/base/options.h"
#include "holba/scene/image_features.h"
#include "holba/scene/reconstruction.h"

namespace holba {

// Votes.

struct GroupVotingOptions {
  // Matched features that two groups must share; the paper's "exceeds 3".
  int min_num_votes = 4;
  void Describe(OptionTable* table) const;
};

struct GroupMatch {
  image_t image_id1 = kInvalidId32;  // < image_id2
  group2D_t group2D_idx1 = kInvalidId32;
  image_t image_id2 = kInvalidId32;
  group2D_t group2D_idx2 = kInvalidId32;
  uint32_t num_votes = 0;
};

struct GroupVotingReport {
  size_t num_matches = 0;
  size_t num_pairs_with_votes = 0;        // pairs of groups with one vote at least
  std::map<std::string, size_t> dropped;  // pairs of groups, by reason
};

// Pairs of groups of one type in different images, ascending. A vote: a 3D point or line that both
// groups observe, or a match of segments (`line_matches`, may be null) that belong to them and not
// both to 3D lines. Vanishing points may be matched so, too.
std::vector<GroupMatch> MatchGroupsByVotes(const Reconstruction& model,
                                           const LineMatchMap* line_matches,
                                           const GroupVotingOptions& options,
                                           GroupVotingReport* report);

// Warping.

// Where the pixels of image 1 are in image 2. The grid covers image 1, whose size may differ.
struct CorrespondenceField {
  int width = 0;
  int height = 0;
  // Row by row: in pixels of an image 2 of this size (centre of the first pixel at 0.5); NaN: not
  // seen there.
  std::vector<Eigen::Vector2f> target;
  double target_width = 0.0;
  double target_height = 0.0;
  std::vector<float> certainty;  // 0 to 1; empty: all the same
};

struct RegionWarpOptions {
  // The paper's: overlap ratio above 0.6, intersection above 1000 px of an image whose long side is
  // 800 px.
  double min_overlap = 0.6;
  double min_intersection_px = 1000.0;
  // Correspondences less certain than this count as not seen.
  double min_certainty = 0.3;
  void Describe(OptionTable* table) const;
};

struct RegionMatch {
  uint16_t label1 = 0;
  uint16_t label2 = 0;
  double overlap = 0.0;          // see below
  double intersection_px = 0.0;  // of image 1 with a long side of 800 px
};

struct RegionWarpReport {
  size_t num_matches = 0;
  std::map<std::string, size_t> dropped;  // pairs of regions that meet, by reason
};

// Pairs of typed regions of one type, ascending. The overlap ratio is that of intersection and
// union of region 1 and the pulled-back region 2, where both images see: pixels of image 1 without
// a place in image 2 count for neither. So regions that an image's border cuts off still match.
std::vector<RegionMatch> MatchRegionsByWarping(const LabelMap& map1, const LabelMap& map2,
                                               const CorrespondenceField& field,
                                               const RegionWarpOptions& options,
                                               RegionWarpReport* report);

struct FieldInterpolationOptions {
  // Long side of the field's grid: areas of regions need no more.
  int long_side = 400;
  // Triangles with a longer side span different surfaces; of 800 px, in either image.
  double max_side_px = 120.0;
  void Describe(OptionTable* table) const;
};

// The field of sparse matches (pixels of image 1, of image 2): affine in each triangle of their
// Delaunay triangulation in image 1; NaN in triangles that are too large, turned over or
// degenerate. Repeatable; matches outside of the images are left out.
CorrespondenceField InterpolateMatches(
    std::span<const std::pair<Eigen::Vector2d, Eigen::Vector2d>> matches,
    const Eigen::Vector2d& size1, const Eigen::Vector2d& size2,
    const FieldInterpolationOptions& options);

}  // namespace holba
