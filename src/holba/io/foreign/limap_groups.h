// SPDX-License-Identifier: BSD-3-Clause
// Group types as LIMAP 2.0 numbers them and the parameters that it gives them:
//   VP 0 and PLANE 1 as ours; SPHERE 2: c, ln r; CYLINDER 3: q, w1 w2, ln r (orthonormal axis:
//   d = R e0, m = R e1 w2 / w1); ELLIPSOID 4: q, c, ln s; CUBOID 5: q, d0 .. d5 with n_i.x = d_i
//   (ours: n_i.x + w_i = 0, the same faces); CONE 6: apex, axis, ln tan of the half-angle, both
//   nappes. q is x y z w.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <vector>

#include "holba/group/group_type.h"

namespace holba {

// Null: no such code.
const GroupType* GroupTypeOfLimap(int code);
// -1: LIMAP has no such type.
int LimapCodeOf(const GroupType& type);
// Numbers of parameters in 3D, and of a group as seen in one image.
size_t NumLimapParams(const GroupType& type);
size_t NumLimapParams2D(const GroupType& type);

// Plain values of FORMAT.md, of LIMAP's that are as many as NumLimapParams. The cone opens towards
// most of its members (LIMAP's opens both ways). Empty: they are no group of this type.
std::optional<std::vector<double>> ParamsFromLimap(const GroupType& type,
                                                   std::span<const double> limap,
                                                   std::span<const Eigen::Vector3d> members);
std::vector<double> ParamsToLimap(const GroupType& type, std::span<const double> plain);

}  // namespace holba
