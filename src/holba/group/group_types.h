// SPDX-License-Identifier: BSD-3-Clause
// The list of group types: a new one adds its header and its line, in the order of the codes. CMake
// reads the lines, too, and compiles each type in a file of its own.
#pragma once

#include <algorithm>
#include <array>
#include <functional>

#include "holba/group/bezier_curve.h"
#include "holba/group/cone.h"
#include "holba/group/cuboid.h"
#include "holba/group/cylinder.h"
#include "holba/group/ellipsoid.h"
#include "holba/group/plane.h"
#include "holba/group/sphere.h"
#include "holba/group/torus.h"
#include "holba/group/vanishing_point.h"

namespace holba {

template <typename... Types>
struct GroupTypeList {
  static constexpr std::array<int, sizeof...(Types)> kCodes{Types::kTypeCode...};
};

// clang-format off
using GroupTypes = GroupTypeList<
    VanishingPoint,
    Plane,
    Sphere,
    Cylinder,
    Cone,
    Ellipsoid,
    Cuboid,
    Torus,
    BezierCurve>;
// clang-format on

static_assert(std::ranges::adjacent_find(GroupTypes::kCodes, std::ranges::greater_equal()) ==
                  GroupTypes::kCodes.end(),
              "group types are listed by ascending code, each code once");

}  // namespace holba
