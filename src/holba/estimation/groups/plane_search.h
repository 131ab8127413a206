// SPDX-License-Identifier: BSD-3-Clause
// Search of planes among points by sampling: the plane whose largest connected set of points gains
// most, again and again, each of its points taken from those after it.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "holba/estimation/groups/plane_detection.h"
#include "holba/estimation/groups/plane_points.h"

namespace holba {

// Connected sets of coplanar points among the free ones. `vp_normals`: likely normals.
std::vector<FoundPlane> SearchPlanes(const PlaneOptions& options, const PlanePoints& points,
                                     const std::vector<Eigen::Vector3d>& vp_normals,
                                     std::vector<bool> is_free);

}  // namespace holba
