// SPDX-License-Identifier: BSD-3-Clause
// The group types that code outside of this room knows by name. What any type can do is asked of
// the type itself: GroupType::IsParallelism, TakesPoints, TakesLines, HasDirection.
#pragma once

#include "holba/group/group_type.h"

namespace holba {

const GroupType& PlaneType();
const GroupType& VanishingPointType();
const GroupType& CuboidType();

inline bool IsPlane(const GroupType& type) { return &type == &PlaneType(); }
inline bool IsVanishingPoint(const GroupType& type) { return &type == &VanishingPointType(); }
inline bool IsCuboid(const GroupType& type) { return &type == &CuboidType(); }

}  // namespace holba
