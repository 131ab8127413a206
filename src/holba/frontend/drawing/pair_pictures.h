// SPDX-License-Identifier: BSD-3-Clause
// Pictures of what was found in single photographs and between two of them, before anything is
// known in 3D: what an image holds, and matches of two images side by side.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <vector>

#include "holba/frontend/photographs/photograph.h"
#include "holba/geometry/line.h"
#include "holba/scene/image_features.h"
#include "holba/scene/two_view_geometry.h"

namespace holba {

struct ShownImage {
  std::string name;
  ColourImage photograph;     // without pixels: features are drawn on white
  int width = 0, height = 0;  // of the camera: features are in its pixels
  std::vector<Eigen::Vector2d> points;
  std::vector<LineSegment2d> segments;
  std::vector<int32_t> vp_of_segment;  // as ImageFeatures has it; empty: none
  std::vector<Eigen::Vector2d> corners;
};

struct ShownPair {
  std::string geometry;  // what was found between the images, in words: "calibrated"; may be empty
  PointMatches inliers;
  PointMatches rejected;            // the other matches
  std::vector<LineMatch> segments;  // matches of segments that are shown
};

// One row: points as dots, corners as rings, segments in the colours of their vanishing points
// (grey: of none), with their numbers above. The longer side is `size_px`, at most that of the
// photograph or camera.
ColourImage DrawImageFeatures(const ShownImage& image, int size_px);

// Rows of both images side by side, `size_px` for the longer side of each: what they hold, the
// inliers (each in a colour of its own), the rejected matches, the matched segments in the same
// colour on both sides. A row without matches is left out.
ColourImage DrawImagePair(const ShownImage& image1, const ShownImage& image2, const ShownPair& pair,
                          int size_px);

}  // namespace holba
