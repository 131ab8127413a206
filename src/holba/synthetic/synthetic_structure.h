// SPDX-License-Identifier: BSD-3-Clause
// The true 3D structure of a synthetic scene, by indices, before any camera sees it.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "holba/base/random.h"
#include "holba/group/group_type.h"
#include "holba/scene/reconstruction.h"
#include "holba/scene/types.h"

namespace holba {

using Segment3d = std::array<Eigen::Vector3d, 2>;

struct SyntheticGroup {
  const GroupType* type = nullptr;
  std::vector<double> params;  // plain values of the file
  std::vector<uint32_t> points, lines;
};

struct SyntheticEdge {
  uint32_t point, line;
  friend auto operator<=>(const SyntheticEdge&, const SyntheticEdge&) = default;
};

struct SyntheticRelation {
  uint32_t group1, group2;
  RelationType type;
};

struct SyntheticStructure {
  std::vector<Eigen::Vector3d> points;
  std::vector<Segment3d> segments;
  std::vector<SyntheticGroup> groups;
  std::vector<SyntheticEdge> edges;
  std::vector<SyntheticRelation> relations;
  std::vector<int> plane_of_line;  // group whose lines share views, -1: floating
  std::vector<int> axis_of_line;   // the world axis that it is parallel to, -1: any direction
};

// Where the features of one plane, and what floats beside it, may lie.
struct SyntheticRegion {
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  Eigen::Vector3d half_extent = Eigen::Vector3d::Zero();
  bool is_corridor = false;  // planes across y and z are then walls, floor and ceiling
};

// One plane normal to a world axis with 4 lines and 28 points, a floating line with 3 points and 19
// floating points: 50 points, 5 lines, 15 edges.
void AddPlaneWithSurroundings(const SyntheticRegion& region, Random* random,
                              SyntheticStructure* structure);
// A floating line with 3 points and 7 floating points: 10 points, 1 line, 3 edges.
void AddFloatingFeatures(const SyntheticRegion& region, Random* random,
                         SyntheticStructure* structure);
// Three vanishing points over the lines along the axes, orthogonal to each other, and each plane
// parallel to (its normal along) one of them.
void AddVanishingPoints(SyntheticStructure* structure);
// One group of `type` with 60 points spread over its surface, as far as it fits into the region;
// shape, rotation and place are random. Throws InputError for a type with parameters of unknown
// names.
void AddPrimitive(const GroupType& type, const SyntheticRegion& region, Random* random,
                  SyntheticStructure* structure);
// All types but planes and vanishing points.
std::vector<const GroupType*> PrimitiveTypes();

}  // namespace holba
