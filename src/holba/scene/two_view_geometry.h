// SPDX-License-Identifier: BSD-3-Clause
// Matches of the keypoints of two images, and the geometry of the two views that verifies them.
#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>
#include <string_view>
#include <vector>

#include "holba/geometry/rigid3d.h"
#include "holba/scene/types.h"

namespace holba {

// Indices of keypoints in the first and in the second image.
using PointMatches = std::vector<std::array<point2D_t, 2>>;

// The same with the images' roles exchanged.
PointMatches Swapped(PointMatches matches);

// COLMAP's numbers.
enum class TwoViewConfig : int {
  kUndefined = 0,
  kDegenerate = 1,
  kCalibrated = 2,
  kUncalibrated = 3,
  kPlanar = 4,
  kPanoramic = 5,
  kPlanarOrPanoramic = 6,
  kWatermark = 7,
  kMultiple = 8,
  kCalibratedRig = 9,
};

// As reports name it: "calibrated", "planar_or_panoramic".
std::string_view NameOf(TwoViewConfig config);

struct TwoViewGeometry {
  TwoViewConfig config = TwoViewConfig::kUndefined;
  std::optional<Eigen::Matrix3d> F, E, H;  // x2' F x1 = 0, x2 ~ H x1
  std::optional<Rigid3d> cam2_from_cam1;   // translation up to scale
  PointMatches inlier_matches;

  // The same with the images' roles exchanged. An H without inverse is left out.
  TwoViewGeometry Swapped() const;
};

}  // namespace holba
