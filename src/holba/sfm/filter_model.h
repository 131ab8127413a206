// SPDX-License-Identifier: BSD-3-Clause
// Takes out of a growing model what contradicts it.
#pragma once

#include <cstddef>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "holba/sfm/mapper_options.h"
#include "holba/sfm/mapper_state.h"

namespace holba {

// Observations with too large errors or from behind, and points that are seen under too small
// angles. Returns the number of observations removed. Points that are gone are passed over.
size_t FilterPoints(const FilterOptions& options, std::span<const point3D_t> point_ids,
                    MapperState* state);
size_t FilterAllPoints(const FilterOptions& options, MapperState* state);

// Frames without any observation, or whose camera has become one that no lens is: they wait again.
std::vector<image_t> FilterFrames(const FilterOptions& options, MapperState* state);

// Whether intrinsics are those of a lens.
bool IsPlausible(const FilterOptions& options, const Camera& camera);

}  // namespace holba
