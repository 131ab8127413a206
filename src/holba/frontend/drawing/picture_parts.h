// SPDX-License-Identifier: BSD-3-Clause
// What the pictures of a model have in common: colours, paths through a lens, a strip that says
// what colours mean.
#pragma once

#include <Eigen/Core>
#include <array>
#include <map>
#include <string>
#include <unordered_map>
#include <vector>

#include "holba/frontend/drawing/pictures.h"

namespace holba {

std::map<group3D_t, Rgb> GroupColours(const Reconstruction& model);
// Of the lines that belong to a vanishing point.
std::unordered_map<line3D_t, Rgb> LineColours(const Reconstruction& model);
Rgb ColourOr(const std::unordered_map<line3D_t, Rgb>& colours, line3D_t id, const Rgb& other);

// From pixels of the camera to those of the photograph.
Eigen::Vector2d PhotographScale(const Reconstruction& model, const Image& image,
                                const ColourImage& photograph);

// Places of the photograph along the image of what is straight in the world between two pixels of
// the camera: the chord of a pinhole, a curve of a lens that distorts.
std::vector<Eigen::Vector2d> AlongLens(const Camera& camera, const Eigen::Vector2d& start,
                                       const Eigen::Vector2d& end, const Eigen::Vector2d& scale);

using Triangle2d = std::array<Eigen::Vector2d, 3>;
// The region of points: their Delaunay triangles without the long ones. `diagonal`: of what they
// lie in, which bounds what is long.
std::vector<Triangle2d> RegionTriangles(const std::vector<Eigen::Vector2d>& points,
                                        double diagonal);

// The photograph as lines are drawn upon: half as colourful, two thirds as dark.
ColourImage Pale(const ColourImage& photograph);

// Dark blue to yellow for 0 to 1, brighter and brighter: viridis (van der Walt and Smith, 2015).
Rgb ScaleColour(double t);

struct LegendEntry {
  enum class Swatch { kLine, kArea, kDot, kScale, kBar };
  Swatch swatch = Swatch::kLine;
  Rgb colour{};
  std::string text;
  double length_px = 0.0;  // of a bar
};
// The picture with its legend under it, in rows. Without entries: the picture.
ColourImage WithLegend(const ColourImage& picture, const std::vector<LegendEntry>& entries);

}  // namespace holba
