// SPDX-License-Identifier: BSD-3-Clause
// Lines and points that lie on planes which are known already.
#pragma once

#include <cstddef>
#include <map>
#include <span>
#include <string>

#include "holba/base/options.h"
#include "holba/scene/reconstruction.h"

namespace holba {

struct PlaneMemberOptions {
  // Farthest from the plane, in GSD (points: in PointGeometry::LengthPerPx).
  double max_distance_px = 2.0;
  // A feature is on the plane where the plane is: the nearest member points are no farther than
  // this from a point, or from each end of a line; or the line's end is within their convex hull.
  double max_neighbour_px = 60.0;
  int min_line_images = 3;
  int num_threads = -1;

  void Describe(OptionTable* table) const;
};

struct PlaneMemberReport {
  size_t added = 0;               // memberships
  size_t features_on_planes = 0;  // lines (points) that are members of a plane, old ones included
  std::map<std::string, size_t> dropped;  // features that came near a plane, by what kept them off
};

// Makes 3D lines with both ends on a plane members of it; a line where planes meet is on both. Of
// planes side by side (under 30 degrees) a feature joins the nearest, and none if it is on one
// already.
PlaneMemberReport AddLinesToPlanes(const PlaneMemberOptions& options, Reconstruction* model);

// Makes points members of the planes that they are on: points that came after DetectPlanes, corners
// where planes meet. `point_ids`: those to look at; empty: all.
PlaneMemberReport AddPointsToPlanes(const PlaneMemberOptions& options,
                                    std::span<const point3D_t> point_ids, Reconstruction* model);

}  // namespace holba
