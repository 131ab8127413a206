// SPDX-License-Identifier: BSD-3-Clause
// What the formats of other programs hold of a model: the meshes of its groups, and its lines by
// direction. World frame, model units.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "holba/group/group_type.h"
#include "holba/scene/reconstruction.h"

namespace holba {

struct GroupShape {
  group3D_t group3D_id = kNoId;
  std::string name;  // "plane_4"
  std::array<uint8_t, 3> rgb{};
  GroupMesh mesh;  // of its extent near its members; empty for a type without one
};
// Of all groups, in the order of the model; neighbours differ in colour.
std::vector<GroupShape> GroupShapes(const Reconstruction& model);

// Lines that are parallel by a vanishing point, or those of none.
struct LineLayer {
  std::string name;  // "direction_1", "no_direction"
  std::array<uint8_t, 3> rgb{};
  std::vector<line3D_t> line3D_ids;
};
// Of the vanishing points that have lines, in the order of the model, and last of the other lines.
// Each line is in one layer: that of the first vanishing point it belongs to.
std::vector<LineLayer> LineLayers(const Reconstruction& model);

}  // namespace holba
