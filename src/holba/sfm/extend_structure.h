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

// After each image: lines that are along none join the vanishing point that the image vanishing
// points of their segments belong to, where most of the images say so and they run along. Returns
// how many. The cost is that of the lines given.
size_t LabelNewLines(const StructureOptions& options, std::span<const line3D_t> line_ids,
                     MapperState* state);

// After adjustments of all: vanishing points, members, incidences and relations anew, and planes
// among the points that are on none. It costs what the model costs, and is called each time the
// model has grown by a share of itself.
void RebuildGroups(const MapperOptions& options, MapperState* state);

}  // namespace holba
