// SPDX-License-Identifier: BSD-3-Clause
// Corners of two posed images that may be one point, by place and descriptor.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include "holba/estimation/wireframe/corner_tracks.h"
#include "holba/scene/ideal_view.h"

namespace holba {

// The described corners of one image that have a place in ideal pixels, in cells.
class CornerField {
 public:
  CornerField(const IdealView& view, const ImageFeatures& features);

  size_t size() const { return corners_.size(); }
  const IdealView& view() const { return *view_; }
  const Eigen::Vector2d& ideal(size_t i) const { return corners_[i]; }
  // Position in ImageFeatures::corners.
  size_t FeatureIdx(size_t i) const { return feature_idxs_[i]; }
  const uint8_t* descriptor(size_t i) const {
    return descriptors_.data() + i * kCornerDescriptorSize;
  }
  double descriptor_norm(size_t i) const { return norms_[i]; }

  // Calls visit(i) for every corner in the rectangle that reaches `reach_px` from the segment
  // across and along it, and for some around it.
  template <typename Visit>
  void ForEachNear(const LineSegment2d& segment, double reach_px, Visit visit) const;

 private:
  const IdealView* view_;
  std::vector<Eigen::Vector2d> corners_;  // in the order of their cells
  std::vector<uint32_t> feature_idxs_;
  std::vector<uint8_t> descriptors_;
  std::vector<double> norms_;
  Eigen::Vector2d origin_ = Eigen::Vector2d::Zero();
  int columns_ = 0, rows_ = 0;
  std::vector<uint32_t> begin_;  // of each cell, and the end
};

struct DepthRange {
  double nearest = 0.0, farthest = 0.0;
};

struct CornerMatch {
  uint32_t corner1 = 0, corner2 = 0;  // in the fields
  float distance = 0.0f;              // of unit descriptors
};

// Mutually nearest descriptors among corners that may be one point within both ranges of depth and
// pass the tests of the options.
std::vector<CornerMatch> MatchCorners(const CornerField& field1, const DepthRange& depths1,
                                      const CornerField& field2, const DepthRange& depths2,
                                      const CornerTrackOptions& options);

// Where in view2 a point at depths [near, far] of view1's pixel appears, cut to the depths of
// view2; empty: nowhere.
std::optional<LineSegment2d> EpipolarSegment(const IdealView& view1, const DepthRange& depths1,
                                             const Eigen::Vector2d& ideal1, const IdealView& view2,
                                             const DepthRange& depths2);

}  // namespace holba
