// SPDX-License-Identifier: BSD-3-Clause
// What an image whose pose is wanted sees of a model: matches of which many may be wrong, one
// feature of the image with several of the model, too. World frame and units are the model's.
//
// relative_sigma: noise of this sighting in units of that of its kind; greater where the feature of
// the model is uncertain.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "holba/geometry/line.h"

namespace holba {

struct PointSighting {
  Eigen::Vector2d pixel;
  Eigen::Vector3d X;  // world
  double relative_sigma = 1.0;
};

// Any part of the line may be what the segment shows.
struct LineSighting {
  LineSegment2d segment;  // pixels of the photograph
  PlueckerLine line;      // world
  double relative_sigma = 1.0;
};

// A vanishing direction: without a sign. Unit vectors. In the camera it is that of the calibration
// that comes with the sightings; another focal length turns it so that its ideal pixel stays.
struct DirectionSighting {
  Eigen::Vector3d direction_in_cam, direction_in_world;
  double relative_sigma = 1.0;
};

struct AbsolutePoseMatches {
  std::vector<PointSighting> points;
  std::vector<LineSighting> lines;
  std::vector<DirectionSighting> directions;
};

// A number for each kind of sighting.
template <typename T>
struct ForEachKind {
  T points{}, lines{}, directions{};
};

}  // namespace holba
