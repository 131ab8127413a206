// SPDX-License-Identifier: BSD-3-Clause
// What is true of a place, as a model of ours: points on its surfaces and corners, edges as lines,
// planes and primitives with their parameters, vanishing points, wireframe and relations, all as
// the images see them. Observations are exact: the residuals of the model are zero but for
// rounding.
#pragma once

#include <cstdint>

#include "holba/render/place.h"
#include "holba/render/ray_caster.h"
#include "holba/scene/reconstruction.h"

namespace holba {

struct TruthOptions {
  int num_points_per_image = 100;  // places on surfaces, chosen evenly over each image
  double min_segment_px = 10.0;    // parts of edges that are shorter are no segments
};

// The group of an entity, here and in label maps. 0 names nothing.
inline group3D_t GroupOfEntity(int entity) { return static_cast<group3D_t>(entity) + 1; }

// Adds all of it to a model that holds cameras, rigs, frames and images with their poses.
void AddTruth(const Place& place, const RayCaster& caster, const TruthOptions& options,
              uint64_t seed, int num_threads, Reconstruction* model);

}  // namespace holba
