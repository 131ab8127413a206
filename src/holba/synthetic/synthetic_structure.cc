// SPDX-License-Identifier: BSD-3-Clause
#include "holba/synthetic/synthetic_structure.h"

#include "holba/group/known_types.h"

namespace holba {
namespace {

constexpr int kGridSize = 3;
constexpr int kPointsOfLine = 3;
constexpr int kMorePointsOfPlane = 19;
constexpr int kFloatingPointsOfPlane = 19;
constexpr int kFloatingPointsOfImage = 7;

Eigen::Vector3d PointIn(const SyntheticRegion& region, Random* random) {
  Eigen::Vector3d X;
  for (int i = 0; i < 3; ++i) {
    X[i] = region.centre[i] + random->Uniform(-region.half_extent[i], region.half_extent[i]);
  }
  return X;
}

uint32_t AddPoint(const Eigen::Vector3d& X, SyntheticStructure* structure) {
  structure->points.push_back(X);
  return static_cast<uint32_t>(structure->points.size() - 1);
}

uint32_t AddLine(const Segment3d& segment, int plane, int axis, SyntheticStructure* structure) {
  structure->segments.push_back(segment);
  structure->plane_of_line.push_back(plane);
  structure->axis_of_line.push_back(axis);
  return static_cast<uint32_t>(structure->segments.size() - 1);
}

void AddFloatingLine(const SyntheticRegion& region, Random* random, SyntheticStructure* structure) {
  const double min_length = 0.5 * region.half_extent.minCoeff();
  Segment3d segment;
  do {
    segment = {PointIn(region, random), PointIn(region, random)};
  } while ((segment[1] - segment[0]).norm() < min_length);
  const uint32_t line = AddLine(segment, -1, -1, structure);
  for (int k = 0; k < kPointsOfLine; ++k) {
    const Eigen::Vector3d X = segment[0] + random->Uniform() * (segment[1] - segment[0]);
    structure->edges.push_back({AddPoint(X, structure), line});
  }
}

}  // namespace

void AddPlaneWithSurroundings(const SyntheticRegion& region, Random* random,
                              SyntheticStructure* structure) {
  const int axis = static_cast<int>(random->Index(3));
  const int u = (axis + 1) % 3, v = (axis + 2) % 3;
  double relative = random->Uniform(-1.0, 1.0);
  if (region.is_corridor && axis != 0)
    relative = std::copysign(1.0 - 0.2 * std::abs(relative), relative);
  const double offset = region.centre[axis] + relative * region.half_extent[axis];
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();
  normal[axis] = 1.0;

  SyntheticGroup plane{&PlaneType(), {normal.x(), normal.y(), normal.z(), -offset}, {}, {}};
  const int plane_idx = static_cast<int>(structure->groups.size());
  Eigen::Vector3d origin, step = Eigen::Vector3d::Zero();
  origin[axis] = offset;
  for (const int k : {u, v}) {
    const double half = region.half_extent[k];
    step[k] = half * random->Uniform(0.25, 0.5);
    origin[k] = region.centre[k] + random->Uniform(-1.0, 1.0) * (half - step[k]) - step[k];
  }
  uint32_t grid[kGridSize][kGridSize];
  for (int i = 0; i < kGridSize; ++i) {
    for (int j = 0; j < kGridSize; ++j) {
      Eigen::Vector3d X = origin;
      X[u] += i * step[u];
      X[v] += j * step[v];
      grid[i][j] = AddPoint(X, structure);
      plane.points.push_back(grid[i][j]);
    }
  }
  // The first and the last row and column: a frame with its corners as junctions.
  for (const int k : {0, kGridSize - 1}) {
    for (const bool is_row : {true, false}) {
      const auto at = [&](int i) { return is_row ? grid[k][i] : grid[i][k]; };
      const Segment3d segment{structure->points[at(0)], structure->points[at(kGridSize - 1)]};
      const uint32_t line = AddLine(segment, plane_idx, is_row ? v : u, structure);
      plane.lines.push_back(line);
      for (int i = 0; i < kGridSize; ++i) structure->edges.push_back({at(i), line});
    }
  }
  for (int k = 0; k < kMorePointsOfPlane; ++k) {
    Eigen::Vector3d X = PointIn(region, random);
    X[axis] = offset;
    plane.points.push_back(AddPoint(X, structure));
  }
  structure->groups.push_back(std::move(plane));
  AddFloatingLine(region, random, structure);
  for (int k = 0; k < kFloatingPointsOfPlane; ++k) AddPoint(PointIn(region, random), structure);
}

void AddFloatingFeatures(const SyntheticRegion& region, Random* random,
                         SyntheticStructure* structure) {
  AddFloatingLine(region, random, structure);
  for (int k = 0; k < kFloatingPointsOfImage; ++k) AddPoint(PointIn(region, random), structure);
}

void AddVanishingPoints(SyntheticStructure* structure) {
  const uint32_t first = static_cast<uint32_t>(structure->groups.size());
  for (int axis = 0; axis < 3; ++axis) {
    SyntheticGroup vp{&VanishingPointType(), {0.0, 0.0, 0.0}, {}, {}};
    vp.params[axis] = 1.0;
    for (uint32_t line = 0; line < structure->segments.size(); ++line) {
      if (structure->axis_of_line[line] == axis) vp.lines.push_back(line);
    }
    structure->groups.push_back(std::move(vp));
  }
  for (uint32_t a = 0; a < 3; ++a) {
    for (uint32_t b = a + 1; b < 3; ++b) {
      structure->relations.push_back({first + a, first + b, RelationType::kOrthogonal});
    }
  }
  for (uint32_t group = 0; group < first; ++group) {
    if (!IsPlane(*structure->groups[group].type)) continue;
    for (uint32_t axis = 0; axis < 3; ++axis) {
      if (structure->groups[group].params[axis] != 0.0) {
        structure->relations.push_back({group, first + axis, RelationType::kParallel});
      }
    }
  }
}

}  // namespace holba
