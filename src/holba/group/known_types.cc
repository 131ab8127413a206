// SPDX-License-Identifier: BSD-3-Clause
#include "holba/group/known_types.h"

namespace holba {

// Each type's table is compiled in a file of its own, as all_group_types.cc.in has it.
template <typename G>
const GroupType& TableOf();

struct Plane;
struct VanishingPoint;
struct Cuboid;

const GroupType& PlaneType() { return TableOf<Plane>(); }
const GroupType& VanishingPointType() { return TableOf<VanishingPoint>(); }
const GroupType& CuboidType() { return TableOf<Cuboid>(); }

}  // namespace holba
