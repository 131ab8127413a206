// SPDX-License-Identifier: BSD-3-Clause
// What is found in single images and pairs of images, before anything in it is known in 3D: the
// currency between detectors, importers, the database and the stages that build 3D structure.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <map>
#include <optional>
#include <utility>
#include <vector>

#include "holba/geometry/line.h"
#include "holba/group/group_type.h"
#include "holba/scene/types.h"

namespace holba {

inline constexpr int kSegmentDescriptorSize = 72;
inline constexpr int kCornerDescriptorSize = 128;

struct ImageVanishingPoint {
  // Unit, camera frame; the sign is free (a vanishing point and its opposite are one).
  Eigen::Vector3d direction_in_cam = Eigen::Vector3d::UnitZ();
  uint32_t num_segments = 0;  // that support it
};

// Labels of pixels as a segmentation gives them; 0: nothing.
struct LabelMap {
  int width = 0;  // may differ from the image's: the map covers the whole image
  int height = 0;
  std::vector<uint16_t> labels;                // row by row
  std::map<uint16_t, const GroupType*> types;  // what a label's region is; others are ignored

  bool empty() const { return labels.empty(); }
};

// What a monocular network says about one labelled region.
struct RegionNormal {
  Eigen::Vector3d normal_in_cam = Eigen::Vector3d::UnitZ();  // unit
  double sigma_deg = 0.0;
};

struct ImageFeatures {
  // Pixels of the photograph as it is (distorted). Oriented: the brighter side is where
  // LineSegment2d::Line() is positive.
  std::vector<LineSegment2d> segments;
  // kSegmentDescriptorSize values for each segment, unit Euclidean norm; empty: not described.
  std::vector<float> segment_descriptors;
  // Sub-pixel corners, and kCornerDescriptorSize values for each; pixels as above.
  std::vector<Eigen::Vector2d> corners;
  std::vector<uint8_t> corner_descriptors;
  std::vector<ImageVanishingPoint> vanishing_points;
  // For each segment the vanishing point it runs to (index), -1: none.
  std::vector<int32_t> vp_of_segment;
  LabelMap label_map;                        // empty: none
  std::map<uint16_t, RegionNormal> normals;  // by label; from normal or depth maps
};
using ImageFeatureMap = std::map<image_t, ImageFeatures>;

struct LineMatch {
  line2D_t idx1 = kInvalidId32;
  line2D_t idx2 = kInvalidId32;
  float distance = 0.0f;  // smaller is better
};
// first < second, as in COLMAP's databases.
using ImagePair = std::pair<image_t, image_t>;
// One segment may have several matches in an image: which is right, geometry decides.
using LineMatchMap = std::map<ImagePair, std::vector<LineMatch>>;

}  // namespace holba
