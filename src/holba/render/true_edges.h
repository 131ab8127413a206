// SPDX-License-Identifier: BSD-3-Clause
// Which parts of the true edges an image shows: where the two sides of the projected edge show
// different surfaces of which one at least ends there or is bent there.
#pragma once

#include <optional>
#include <vector>

#include "holba/render/place.h"
#include "holba/render/ray_caster.h"
#include "holba/scene/reconstruction.h"

namespace holba {

// Metres: rounding of what was built, far below what is built.
inline constexpr double kSamePlace = 1e-7;

// Edges of one line that touch or overlap become one; edges shorter than a millimetre go.
std::vector<Edge> MergeEdges(const std::vector<Edge>& edges);

// Pixel of a point in the camera frame. Empty: outside of the image, or a pixel that shows another
// ray: a lens whose formula folds back beyond its field of view brings points there that no
// photograph has.
std::optional<Eigen::Vector2d> PixelInImage(const Camera& camera,
                                            const Eigen::Vector3d& point_in_cam);

struct VisiblePart {
  double from, to;  // in [0, 1] of the edge
  LineSegment2d segment;
};

// Parts at least `min_length_px` long, in order. Parts nearer than 5 degrees to 90 degrees from the
// camera's axis, where straight lines have no image in ideal pixels, do not count.
std::vector<VisiblePart> VisibleParts(const Place& place, const RayCaster& caster,
                                      const Camera& camera, const Rigid3d& cam_from_world,
                                      const Edge& edge, double min_length_px);

}  // namespace holba
