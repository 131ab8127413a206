// SPDX-License-Identifier: BSD-3-Clause
// The list of group types: a new one adds its header and its line, in the order of the codes.
#pragma once

#include "holba/group/cone.h"
#include "holba/group/cuboid.h"
#include "holba/group/cylinder.h"
#include "holba/group/ellipsoid.h"
#include "holba/group/plane.h"
#include "holba/group/sphere.h"
#include "holba/group/vanishing_point.h"

namespace holba {

template <typename... Types>
struct GroupTypeList {};

// clang-format off
using GroupTypes = GroupTypeList<
    VanishingPoint,
    Plane,
    Sphere,
    Cylinder,
    Cone,
    Ellipsoid,
    Cuboid>;
// clang-format on

}  // namespace holba
