// SPDX-License-Identifier: BSD-3-Clause
// Points of a growing model: made, continued, completed, merged and made again along the graph of
// matches, as COLMAP's incremental triangulator does.
#pragma once

#include <cstddef>
#include <span>

#include "holba/sfm/mapper_options.h"
#include "holba/sfm/mapper_state.h"

namespace holba {

struct PointChanges {
  size_t created = 0;    // points
  size_t continued = 0;  // observations that joined a point
  size_t completed = 0;  // the same, along tracks
  size_t merged = 0;     // points that went into others

  size_t Observations() const { return 2 * created + continued + completed + merged; }
  PointChanges& operator+=(const PointChanges& other);
};

// Keypoints of a registered image join the points of their matches, or make new ones with them.
PointChanges TriangulateImage(const TriangulationOptions& options, image_t image_id,
                              MapperState* state);

// Observations that matches of a track's observations lead to, and points that matches say are one.
// Points that are gone are passed over.
PointChanges CompleteTracks(const TriangulationOptions& options,
                            std::span<const point3D_t> point_ids, MapperState* state);
PointChanges MergeTracks(const TriangulationOptions& options, std::span<const point3D_t> point_ids,
                         MapperState* state);

// Pairs of images of which few matches are triangulated, once poses are better.
PointChanges Retriangulate(const TriangulationOptions& options, MapperState* state);

}  // namespace holba
