// SPDX-License-Identifier: BSD-3-Clause
#include "holba/estimation/groups/plane_detection.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "holba/base/data_testing.h"
#include "holba/estimation/points/point_scene_testing.h"
#include "holba/io/model_io.h"

namespace holba {
namespace {

using testing::SizeIs;

constexpr double kGsd = 10.0 / 700.0;  // about, of what lies 10 before the cameras

// Points spread evenly at random over a rectangle z = depth.
std::set<point3D_t> AddWall(double depth, const Eigen::Vector2d& low, const Eigen::Vector2d& high,
                            int count, double noise_px, Random* random, Reconstruction* model) {
  std::set<point3D_t> ids;
  for (int i = 0; i < count; ++i) {
    ids.insert(
        AddPoint({random->Uniform(low.x(), high.x()), random->Uniform(low.y(), high.y()), depth},
                 noise_px, random, model));
  }
  return ids;
}

void AddClutter(int count, Random* random, Reconstruction* model) {
  for (int i = 0; i < count; ++i) {
    AddPoint({random->Uniform(-4, 4), random->Uniform(-4, 4), random->Uniform(6, 14)}, 0.5, random,
             model);
  }
}

size_t NumCommon(const Group3D& group, const std::set<point3D_t>& ids) {
  return static_cast<size_t>(std::count_if(group.point3D_ids.begin(), group.point3D_ids.end(),
                                           [&](point3D_t id) { return ids.contains(id); }));
}

std::vector<Group3D> Planes(const Reconstruction& model) {
  std::vector<Group3D> planes;
  for (const auto& [id, group] : model.groups3D) planes.push_back(group);
  return planes;
}

double NormalErrorDeg(const Group3D& plane, const Eigen::Vector3d& n) {
  const Eigen::Vector3d found(plane.params[0], plane.params[1], plane.params[2]);
  return std::atan2(found.cross(n).norm(), std::abs(found.dot(n))) * 57.29577951308232;
}

TEST(DetectPlanes, FindsTwoWallsAmongClutterAndNothingElse) {
  Random random(1);
  Reconstruction model = MakeCameraRow(6, 1.0);
  const auto front = AddWall(10, {-3, -3}, {0, 3}, 150, 0.3, &random, &model);
  const auto back = AddWall(12, {0.5, -3}, {3, 3}, 100, 0.3, &random, &model);
  AddClutter(200, &random, &model);
  const PlaneReport report = DetectPlanes({}, &model);
  const std::vector<Group3D> planes = Planes(model);
  ASSERT_THAT(planes, SizeIs(2));
  EXPECT_GE(NumCommon(planes[0], front), 145);
  EXPECT_GE(NumCommon(planes[1], back), 95);
  for (const Group3D& plane : planes) {
    EXPECT_LT(NormalErrorDeg(plane, Eigen::Vector3d::UnitZ()), 0.2);
  }
  EXPECT_LE(planes[0].point3D_ids.size() - NumCommon(planes[0], front), 10);
  EXPECT_LE(planes[1].point3D_ids.size() - NumCommon(planes[1], back), 10);
  EXPECT_EQ(report.planes, 2);
  EXPECT_EQ(report.points_eligible, 450);
  EXPECT_EQ(report.points_on_planes, planes[0].point3D_ids.size() + planes[1].point3D_ids.size());
  EXPECT_EQ(model.FindInconsistency(), std::nullopt);
}

TEST(DetectPlanes, FindsNothingInClutter) {
  Random random(2);
  Reconstruction model = MakeCameraRow(6, 1.0);
  AddClutter(600, &random, &model);
  EXPECT_EQ(DetectPlanes({}, &model).planes, 0);
  EXPECT_TRUE(model.groups3D.empty());
}

TEST(DetectPlanes, KeepsAPanelFivePixelsBeforeItsWallApartAtOnePixelOfNoise) {
  Random random(3);
  Reconstruction model = MakeCameraRow(8, 1.5);
  const auto panel = AddWall(10 - 5 * kGsd, {-1.2, -1.2}, {1.2, 1.2}, 150, 1.0, &random, &model);
  std::set<point3D_t> wall;
  for (const double side : {-1.0, 1.0}) {
    wall.merge(AddWall(10, {-3, std::min(1.3 * side, 3 * side)},
                       {3, std::max(1.3 * side, 3 * side)}, 150, 1.0, &random, &model));
    wall.merge(AddWall(10, {std::min(1.3 * side, 3 * side), -1.3},
                       {std::max(1.3 * side, 3 * side), 1.3}, 60, 1.0, &random, &model));
  }
  DetectPlanes({}, &model);
  const std::vector<Group3D> planes = Planes(model);
  ASSERT_THAT(planes, SizeIs(2));
  EXPECT_GE(NumCommon(planes[0], wall), 370);
  EXPECT_LE(NumCommon(planes[0], panel), 8);
  EXPECT_GE(NumCommon(planes[1], panel), 130);
  EXPECT_LE(NumCommon(planes[1], wall), 8);
  for (const Group3D& plane : planes) {
    EXPECT_LT(NormalErrorDeg(plane, Eigen::Vector3d::UnitZ()), 0.2);
  }
  EXPECT_NEAR(std::abs(std::abs(planes[0].params[3]) - std::abs(planes[1].params[3])), 5 * kGsd,
              0.5 * kGsd);
}

TEST(DetectPlanes, PatchesOfOnePlaneAreOnePlaneAndScatteredCoincidencesAreNot) {
  Random random(4);
  Reconstruction model = MakeCameraRow(6, 1.0);
  const auto left = AddWall(10, {-4, -2}, {-2, 2}, 80, 0.3, &random, &model);
  const auto right = AddWall(10, {2, -2}, {4, 2}, 80, 0.3, &random, &model);
  // On the plane, but far from each other and from the patches, among what is not on it.
  std::set<point3D_t> scattered;
  for (int i = 0; i < 12; ++i) {
    const double x = -1.0 + 2.0 * (i % 3) / 2.0, y = -3.6 + 2.4 * (i / 3);
    scattered.insert(AddPoint({x, y, 10.0}, 0.5, &random, &model));
  }
  for (int i = 0; i < 150; ++i) {
    const double side = i % 2 ? 1.0 : -1.0;
    AddPoint({random.Uniform(-1.5, 1.5), random.Uniform(-4, 4), 10 + side * random.Uniform(0.3, 2)},
             0.5, &random, &model);
  }
  DetectPlanes({}, &model);
  const std::vector<Group3D> planes = Planes(model);
  ASSERT_THAT(planes, SizeIs(1));
  EXPECT_GE(NumCommon(planes[0], left), 77);
  EXPECT_GE(NumCommon(planes[0], right), 77);
  EXPECT_LE(NumCommon(planes[0], scattered), 2);
}

TEST(DetectPlanes, PointsOfFewImagesOrSmallAnglesTakeNoPart) {
  Random random(5);
  Reconstruction few = MakeCameraRow(2, 1.0), near = MakeCameraRow(4, 0.05);
  for (Reconstruction* model : {&few, &near}) {
    AddWall(10, {-3, -3}, {3, 3}, 60, 0.0, &random, model);
  }
  const PlaneReport of_few = DetectPlanes({}, &few), of_near = DetectPlanes({}, &near);
  EXPECT_EQ(of_few.points_eligible, 0);
  EXPECT_EQ(of_few.dropped.at("point: few images"), 60);
  EXPECT_EQ(of_near.points_eligible, 0);
  EXPECT_EQ(of_near.dropped.at("point: small angle"), 60);
}

TEST(DetectPlanes, AFarWallOfUncertainDepthIsOnePlane) {
  Random random(6);
  Reconstruction model = MakeCameraRow(4, 0.8);  // 4.6 degrees at 30: a depth noise of 3.4 GSD
  AddWall(30, {-12, -12}, {12, 12}, 400, 0.2, &random, &model);
  DetectPlanes({}, &model);
  const std::vector<Group3D> planes = Planes(model);
  ASSERT_THAT(planes, SizeIs(1));
  EXPECT_LT(NormalErrorDeg(planes[0], Eigen::Vector3d::UnitZ()), 1.0);
  EXPECT_GT(planes[0].point3D_ids.size(), 300);
}

TEST(DetectPlanes, RepeatsForAnyNumberOfThreads) {
  Random random(7);
  Reconstruction model = MakeCameraRow(6, 1.0);
  AddWall(10, {-3, -3}, {0, 3}, 150, 1.0, &random, &model);
  AddWall(12, {0, -3}, {3, 3}, 100, 1.0, &random, &model);
  AddClutter(200, &random, &model);
  Reconstruction one = model, four = model;
  PlaneOptions options;
  options.num_threads = 1;
  DetectPlanes(options, &one);
  options.num_threads = 4;
  DetectPlanes(options, &four);
  ASSERT_EQ(one.groups3D.size(), four.groups3D.size());
  for (const auto& [id, group] : one.groups3D) {
    EXPECT_EQ(group.params, four.groups3D.at(id).params);
    EXPECT_EQ(group.point3D_ids, four.groups3D.at(id).point3D_ids);
  }
}

TEST(DetectPlanes, LeavesThePointsOfKnownPlanesAlone) {
  Random random(8);
  Reconstruction model = MakeCameraRow(6, 1.0);
  AddWall(10, {-3, -3}, {3, 3}, 150, 0.5, &random, &model);
  EXPECT_EQ(DetectPlanes({}, &model).planes, 1);
  const size_t members = model.groups3D.begin()->second.point3D_ids.size();
  const PlaneReport again = DetectPlanes({}, &model);
  EXPECT_EQ(again.planes, 0);
  EXPECT_EQ(again.points_eligible, 150 - members);
}

// What the study behind these methods found with other code: planes, points on them.
struct RealSet {
  const char* model;
  size_t planes, points;
};
TEST(DetectPlanes, FindsThePlanesOfRealSets) {
  HOLBA_SKIP_WITHOUT_DATA();
  const RealSet sets[] = {{"entry_p10/colmap/pinhole_fixed", 6, 2708},
                          {"fountain_p11/colmap/pinhole_fixed", 13, 3557},
                          {"southbuilding26/colmap/pinhole_fixed", 7, 5253},
                          {"redkitchen40/colmap/pinhole_fixed", 6, 1285},
                          {"herzjesu_p8/colmap/pinhole_fixed", 10, 2134},
                          {"herzjesu_p25/colmap/pinhole_fixed", 21, 5632},
                          {"sceaux_castle/colmap/simple_radial", 7, 2133}};
  for (const RealSet& set : sets) {
    Reconstruction model = ReadModel(DataFolder() / set.model);
    const PlaneReport report = DetectPlanes({}, &model);
    // Pieces of one plane that the study left apart are one here.
    EXPECT_GE(report.planes + report.planes_merged, set.planes) << set.model;
    EXPECT_GE(report.points_on_planes, 0.98 * set.points) << set.model;
    EXPECT_LE(report.median_residual_px, set.model[0] == 'r' ? 0.95 : 0.6) << set.model;
    EXPECT_EQ(model.FindInconsistency(), std::nullopt);
  }
}

}  // namespace
}  // namespace holba
