// SPDX-License-Identifier: BSD-3-Clause
// A group of a model beside the true one of the same type: how far its parameters are off.
#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "holba/geometry/rigid3d.h"
#include "holba/scene/reconstruction.h"

namespace holba {

// In-memory and plain parameters of a group, moved by a similarity.
struct MovedGroup {
  std::array<double, kMaxGroupParams> memory{}, plain{};
};
// Empty: the file's parameters are no valid group.
std::optional<MovedGroup> MoveGroup(const Group3D& group, const Sim3d& new_from_old);

// Points of the model that are on a group of it: member points, ends of member lines.
std::vector<Eigen::Vector3d> MemberPoints(const Reconstruction& model, const Group3D& group);

double UnsignedAngleDeg(const Eigen::Vector3d& a, const Eigen::Vector3d& b);

// Errors by name, both groups in one frame. Of planes "normal_deg" and "offset", the distance from
// the centroid of the true members (without any: from the foot of the true plane); of cuboids
// "centre", "size" and "axes_deg", axes compared with the nearest of the other's; of other types
// "direction_deg" if they have a direction, and by the names of the file's parameters "centre"
// (cx cy cz), "axis_deg" (dx dy dz), "axis_offset" (a Pluecker line: its distance from the centroid
// of the true members, as seen from the true axis), "apex" (ax ay az), "radius" (r),
// "half_angle_deg" (alpha) and "semi_axes" (sx sy sz, sorted by length). Lengths in the unit of the
// coordinates.
std::vector<std::pair<std::string, double>> ParameterErrors(
    const GroupType& type, const MovedGroup& model, const MovedGroup& truth,
    std::span<const Eigen::Vector3d> true_members);

}  // namespace holba
