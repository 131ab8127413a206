// SPDX-License-Identifier: BSD-3-Clause
// What follows a search of planes: two that are one become one, points change to the plane that
// they belong to, and planes that their points do not fill are dropped.
#pragma once

#include <cstddef>
#include <map>
#include <string>
#include <vector>

#include "holba/estimation/groups/plane_detection.h"
#include "holba/estimation/groups/plane_points.h"

namespace holba {

// Makes one of each two planes that are one. Returns how often.
size_t MergePlanes(const PlaneOptions& options, const PlanePoints& points,
                   std::vector<FoundPlane>* planes);

// Gives every point to the nearest plane among those of its neighbours, then refits each plane to
// its points, with small weights for points near the limit.
void ReassignPoints(const PlaneOptions& options, const PlanePoints& points,
                    std::vector<FoundPlane>* planes);

// Removes planes of few points and of points with others among them; counts them in `dropped` by
// reason (null: not counted).
void RemoveWeakPlanes(const PlaneOptions& options, const PlanePoints& points,
                      std::map<std::string, size_t>* dropped, std::vector<FoundPlane>* planes);

}  // namespace holba
