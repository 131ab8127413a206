// SPDX-License-Identifier: BSD-3-Clause
#include "holba/estimation/groups/relations.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <tuple>
#include <vector>

#include "holba/base/random.h"
#include "holba/geometry/angle.h"

namespace holba {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::Pair;
using ::testing::UnorderedElementsAre;

// In the plane of x and y.
Eigen::Vector3d AtAngle(double deg) {
  return {std::cos(deg * kRadPerDeg), std::sin(deg * kRadPerDeg), 0.0};
}

void AddVp(group3D_t id, const Eigen::Vector3d& d, Reconstruction* model) {
  Group3D group;
  group.type = FindGroupType("VP");
  group.params = {d.x(), d.y(), d.z()};
  Line3D line;
  line.line = PlueckerLine::FromPointDirection({1, 2, 3}, d);
  const line3D_t line_id = 1000 + id;
  model->lines3D.Add(line_id, line);
  group.line3D_ids.push_back(line_id);
  model->groups3D.Add(id, group);
}

// 100 points with the given distances (standard deviation) from the plane, spread over 2 by 1.
void AddPlane(group3D_t id, const Eigen::Vector3d& n, double sigma, Reconstruction* model) {
  Random random(id);
  const Eigen::Vector3d u = n.unitOrthogonal(), v = n.cross(u);
  Group3D group;
  group.type = FindGroupType("PLANE");
  group.params = {n.x(), n.y(), n.z(), -5.0};
  for (int i = 0; i < 100; ++i) {
    Point3D point;
    point.xyz = (5.0 + random.Normal(sigma)) * n + random.Uniform(-1, 1) * u +
                random.Uniform(-0.5, 0.5) * v;
    const point3D_t point_id = model->points3D.size() + 1;
    model->points3D.Add(point_id, point);
    group.point3D_ids.push_back(point_id);
  }
  model->groups3D.Add(id, group);
}

std::vector<std::tuple<group3D_t, group3D_t, RelationType>> RelationsOf(
    const Reconstruction& model) {
  std::vector<std::tuple<group3D_t, group3D_t, RelationType>> list;
  for (const Relation& r : model.relations) list.emplace_back(r.group3D_id1, r.group3D_id2, r.type);
  return list;
}

constexpr RelationType kOrthogonal = RelationType::kOrthogonal;
constexpr RelationType kParallel = RelationType::kParallel;

TEST(Relations, OfABoxAreAllOfItsPairs) {
  Reconstruction model;
  AddVp(1, Eigen::Vector3d::UnitX(), &model);
  AddVp(2, -Eigen::Vector3d::UnitY(), &model);
  AddPlane(7, Eigen::Vector3d::UnitX(), 0.001, &model);
  AddPlane(5, Eigen::Vector3d::UnitZ(), 0.001, &model);
  AddPlane(6, -Eigen::Vector3d::UnitZ(), 0.001, &model);
  const RelationReport report = FormRelations({}, &model);
  EXPECT_THAT(RelationsOf(model),
              UnorderedElementsAre(std::tuple(1, 2, kOrthogonal), std::tuple(1, 7, kParallel),
                                   std::tuple(1, 5, kOrthogonal), std::tuple(1, 6, kOrthogonal),
                                   std::tuple(2, 7, kOrthogonal), std::tuple(2, 5, kOrthogonal),
                                   std::tuple(2, 6, kOrthogonal), std::tuple(7, 5, kOrthogonal),
                                   std::tuple(7, 6, kOrthogonal), std::tuple(5, 6, kParallel)));
  EXPECT_EQ(report.num_formed, 10u);
  EXPECT_THAT(report.formed,
              ElementsAre(Pair("PLANE-PLANE orthogonal", 2), Pair("PLANE-PLANE parallel", 1),
                          Pair("PLANE-VP orthogonal", 5), Pair("PLANE-VP parallel", 1),
                          Pair("VP-VP orthogonal", 1)));
  EXPECT_EQ(model.FindInconsistency(), std::nullopt);
  // Once more: nothing is new.
  const RelationReport again = FormRelations({}, &model);
  EXPECT_EQ(again.num_formed, 0u);
  EXPECT_EQ(again.num_known, 10u);
  EXPECT_EQ(model.relations.size(), 10u);
}

TEST(Relations, EndAtTheSigmasOfPreciseDirectionsAndAtTheLargestDeviation) {
  // Two vanishing points: 3 sqrt(2) 0.3 degrees = 1.27.
  for (const auto& [deviation_deg, are_related] :
       {std::pair(1.2, true), std::pair(1.35, false), std::pair(2.9, false)}) {
    Reconstruction model;
    AddVp(1, AtAngle(10), &model);
    AddVp(2, AtAngle(100 + deviation_deg), &model);
    const RelationReport report = FormRelations({}, &model);
    EXPECT_EQ(report.num_formed, are_related ? 1u : 0u) << deviation_deg;
    EXPECT_EQ(report.dropped.empty(), are_related);
  }
  // Two planes: 3 sqrt(2) 0.7 degrees = 2.97; of rough ones the largest deviation ends it.
  for (const auto& [deviation_deg, sigma, are_related] :
       {std::tuple(2.9, 1e-4, true), std::tuple(2.99, 1e-4, false), std::tuple(2.99, 0.1, true),
        std::tuple(3.1, 0.1, false)}) {
    Reconstruction model;
    AddPlane(1, AtAngle(10), sigma, &model);
    AddPlane(2, AtAngle(10 - deviation_deg), sigma, &model);
    EXPECT_EQ(FormRelations({}, &model).num_formed, are_related ? 1u : 0u) << deviation_deg;
  }
}

TEST(Relations, OfAVanishingPointAllowForTheScatterOfItsLines) {
  for (const double scatter_deg : {0.0, 4.0}) {
    Reconstruction model;
    AddVp(1, AtAngle(0), &model);
    AddVp(2, AtAngle(92), &model);
    for (int i = 0; i < 20; ++i) {
      Line3D line;
      line.line = PlueckerLine::FromPointDirection({0, 0, i + 1.0},
                                                   AtAngle(i % 2 ? scatter_deg : -scatter_deg));
      model.lines3D.Add(i + 1, line);
      model.groups3D.at(1).line3D_ids.push_back(i + 1);
    }
    // 4 degrees times 1.4826 over the root of 21 lines: 1.3 degrees, three of which allow for 2.
    EXPECT_EQ(FormRelations({}, &model).num_formed, scatter_deg > 0.0 ? 1u : 0u);
  }
}

TEST(Relations, LeaveOtherGroupsAndFlatFeaturesAlone) {
  Reconstruction model;
  Group3D cylinder;
  cylinder.type = FindGroupType("CYLINDER");
  cylinder.params = {0, 0, 1, 0, 0, 0, 0.5};
  model.groups3D.Add(1, cylinder);
  AddVp(2, Eigen::Vector3d::UnitZ(), &model);
  Group3D plane;  // of points in a row
  plane.type = FindGroupType("PLANE");
  plane.params = {0, 0, 1, 0};
  for (int i = 0; i < 5; ++i) {
    Point3D point;
    point.xyz = Eigen::Vector3d(i, 0, 0);
    model.points3D.Add(i + 1, point);
    plane.point3D_ids.push_back(i + 1);
  }
  model.groups3D.Add(3, plane);
  const RelationReport report = FormRelations({}, &model);
  EXPECT_THAT(model.relations, IsEmpty());
  EXPECT_THAT(report.dropped, ElementsAre(Pair("plane: its members do not span it", 1)));
}

TEST(Relations, KeepTheKnownOneOfAPairWhateverItSays) {
  Reconstruction model;
  AddVp(1, Eigen::Vector3d::UnitX(), &model);
  AddVp(2, Eigen::Vector3d::UnitY(), &model);
  model.relations.push_back({2, 1, kParallel});
  EXPECT_EQ(FormRelations({}, &model).num_known, 1u);
  EXPECT_THAT(RelationsOf(model), ElementsAre(std::tuple(2, 1, kParallel)));
}

}  // namespace
}  // namespace holba
