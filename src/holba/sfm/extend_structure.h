// SPDX-License-Identifier: BSD-3-Clause
// Groups of a growing model: vanishing points, planes, wireframe and relations on the points and
// lines that are there.
#pragma once

#include <cstddef>
#include <span>

#include "holba/sfm/mapper_options.h"
#include "holba/sfm/mapper_state.h"
#include "holba/sfm/structure.h"

namespace holba {

struct GroupChanges {
  size_t lines_joined = 0;   // of vanishing points
  size_t points_joined = 0;  // of planes
};

// After each image: lines and points that came join the groups that are there. A line joins the
// vanishing point that the image vanishing points of its segments belong to, where most of the
// images say so and it runs along; a point joins the plane of the points around it. The cost is
// that of the ids given.
GroupChanges ExtendGroups(const StructureOptions& options, std::span<const point3D_t> point_ids,
                          std::span<const line3D_t> line_ids, MapperState* state);

// After adjustments of all: vanishing points, members, incidences and relations anew, and planes
// among the points that are on none. It costs what the model costs, and is called each time the
// model has grown by a share of itself.
void RebuildGroups(const MapperOptions& options, MapperState* state);

}  // namespace holba
