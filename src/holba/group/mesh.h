// SPDX-License-Identifier: BSD-3-Clause
// Triangle meshes that several group types draw themselves with. Seen from outside, the corners of
// a triangle run counter-clockwise.
#pragma once

#include <Eigen/Core>
#include <span>

#include "holba/group/group_type.h"

namespace holba {

// Unit sphere about the origin, by latitude and longitude.
GroupMesh UnitSphereMesh();

// Side of a cylinder or cone frustum about the unit axis: a circle of radius_low about `low`, one
// of radius_high about `high` (further along the axis). A radius of 0 makes its end a tip.
GroupMesh FrustumMesh(const Eigen::Vector3d& axis, const Eigen::Vector3d& low, double radius_low,
                      const Eigen::Vector3d& high, double radius_high);

// Rectangle along the principal axes of points that lie in the plane with this unit normal. Empty:
// the points span no rectangle.
GroupMesh RectangleMesh(const Eigen::Vector3d& normal, std::span<const Eigen::Vector3d> points);

}  // namespace holba
