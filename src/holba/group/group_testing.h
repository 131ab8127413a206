// SPDX-License-Identifier: BSD-3-Clause
// For the tests of group types: the list as GoogleTest types, and features on and around any group,
// made from its own projection and mesh so that a new type needs nothing here.
#pragma once

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Core>
#include <algorithm>
#include <optional>
#include <type_traits>
#include <vector>

#include "holba/base/random.h"
#include "holba/geometry/line.h"
#include "holba/group/group_capabilities.h"
#include "holba/group/group_types.h"

namespace holba {

template <typename List>
struct AsTestTypes;
template <typename... Types>
struct AsTestTypes<GroupTypeList<Types...>> {
  using type = ::testing::Types<Types...>;
};
using TestedGroups = AsTestTypes<GroupTypes>::type;

// Of these the types that points lie on.
template <typename List, typename... Chosen>
struct PointTypesOf;
template <typename... Chosen>
struct PointTypesOf<GroupTypeList<>, Chosen...> {
  using type = ::testing::Types<Chosen...>;
};
template <typename First, typename... Rest, typename... Chosen>
struct PointTypesOf<GroupTypeList<First, Rest...>, Chosen...> {
  using type = std::conditional_t<ProjectsPoints<First>,
                                  PointTypesOf<GroupTypeList<Rest...>, Chosen..., First>,
                                  PointTypesOf<GroupTypeList<Rest...>, Chosen...>>::type;
};
using TestedPointGroups = PointTypesOf<GroupTypes>::type;

// Equal up to an absolute tolerance in every coefficient.
MATCHER_P2(EigenNear, expected, tolerance, "") {
  const double error = (arg - expected).cwiseAbs().maxCoeff();
  *result_listener << "error " << error << ", allowed " << tolerance;
  return error <= tolerance;
}

inline Eigen::Vector3d RandomVector(Random* random) {
  const double x = random->Uniform(-1, 1), y = random->Uniform(-1, 1);
  return {x, y, random->Uniform(-1, 1)};
}

inline Eigen::Quaterniond RandomRotation(Random* random) {
  return ExpRotation(3.0 * RandomVector(random)).normalized();
}

inline double Extent(const std::vector<Eigen::Vector3d>& points) {
  Eigen::Vector3d low = points.at(0), high = points.at(0);
  for (const Eigen::Vector3d& X : points) {
    low = low.cwiseMin(X);
    high = high.cwiseMax(X);
  }
  return (high - low).norm();
}

// Mesh of the part of the group near where the origin projects, about 1 wide where the group is
// unbounded.
template <typename G>
GroupMesh ExampleMesh(const typename G::Params& g, Random* random) {
  std::vector<Eigen::Vector3d> members;
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  for (int round = 0; round < 3; ++round) {
    members.clear();
    while (members.size() < 200) {
      const auto projected =
          G::ProjectPoint(g.data(), Eigen::Vector3d(centre + RandomVector(random)));
      if (projected) members.push_back(*projected);
    }
    centre = members.back();
  }
  return G::Mesh(g.data(), members);
}

// Points on the bounded surface.
template <typename G>
std::vector<Eigen::Vector3d> SurfacePoints(const typename G::Params& g, size_t num,
                                           Random* random) {
  const GroupMesh mesh = ExampleMesh<G>(g, random);
  EXPECT_FALSE(mesh.triangles.empty());
  std::vector<Eigen::Vector3d> points;
  while (points.size() < num) {
    const auto& [i, j, k] = mesh.triangles.at(random->Index(mesh.triangles.size()));
    const double a = random->Uniform(), b = random->Uniform(0, 1 - a);
    const auto projected =
        G::ProjectPoint(g.data(), Eigen::Vector3d(a * mesh.vertices[i] + b * mesh.vertices[j] +
                                                  (1 - a - b) * mesh.vertices[k]));
    if (projected) points.push_back(*projected);
  }
  return points;
}

// Points off the surface, inside and outside, by up to a third of its size.
template <typename G>
std::vector<Eigen::Vector3d> PointsAround(const typename G::Params& g, size_t num, Random* random) {
  std::vector<Eigen::Vector3d> points = SurfacePoints<G>(g, num, random);
  const double extent = Extent(points);
  for (Eigen::Vector3d& X : points) X += 0.3 * extent * RandomVector(random);
  return points;
}

// Lines through two such points that have a projection.
template <typename G>
std::vector<PlueckerLine> LinesAround(const typename G::Params& g, size_t num, Random* random) {
  const std::vector<Eigen::Vector3d> points = PointsAround<G>(g, 4 * num, random);
  std::vector<PlueckerLine> lines;
  for (size_t i = 0; i + 1 < points.size() && lines.size() < num; i += 2) {
    const PlueckerLine line = PlueckerLine::FromPoints(points[i], points[i + 1]);
    if (G::ProjectLine(g.data(), line.direction, line.moment)) lines.push_back(line);
  }
  EXPECT_EQ(lines.size(), num);
  return lines;
}

inline Vector6d Stacked(const PlueckerLine& line) {
  Vector6d stacked;
  stacked << line.direction, line.moment;
  return stacked;
}

// The same group where it is near the origin and about 1 in size, for comparisons with differences.
template <typename G>
typename G::Params AtUnitSize(const typename G::Params& g, Random* random) {
  const std::vector<Eigen::Vector3d> points = SurfacePoints<G>(g, 50, random);
  Sim3d unit_from_old;
  unit_from_old.scale = 1.0 / Extent(points);
  unit_from_old.translation = -unit_from_old.scale * points[0];
  return G::Transform(unit_from_old, g.data());
}

}  // namespace holba
