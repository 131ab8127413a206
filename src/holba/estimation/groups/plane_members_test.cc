// SPDX-License-Identifier: BSD-3-Clause
#include "holba/estimation/groups/plane_members.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "holba/base/data_testing.h"
#include "holba/estimation/groups/plane_detection.h"
#include "holba/estimation/points/point_scene_testing.h"
#include "holba/io/model_io.h"

namespace holba {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;
using testing::Pair;
using testing::UnorderedElementsAre;

constexpr double kGsd = 10.0 / 700.0;

// Planes z = 10 (group 1: x, y in [-2, 2], points 0.25 apart) and x = 2 (group 2, z in [8, 10]).
Reconstruction MakeCorner() {
  Random random(1);
  Reconstruction model = MakeCameraRow(5, 1.0);
  Group3D wall{.type = FindGroupType("PLANE"), .params = {0, 0, 1, -10}};
  Group3D side{.type = FindGroupType("PLANE"), .params = {1, 0, 0, -2}};
  for (double y = -2; y <= 2; y += 0.25) {
    for (double x = -2; x < 2; x += 0.25) {
      wall.point3D_ids.push_back(AddPoint({x, y, 10}, 0, &random, &model));
    }
    for (double z = 8; z < 10; z += 0.25) {
      side.point3D_ids.push_back(AddPoint({2, y, z}, 0, &random, &model));
    }
  }
  model.groups3D.Add(1, wall);
  model.groups3D.Add(2, side);
  return model;
}

line3D_t AddLine(const Eigen::Vector3d& a, const Eigen::Vector3d& b, Reconstruction* model) {
  const line3D_t id = model->lines3D.size() + 1;
  Line3D line{.line = PlueckerLine::FromPoints(a, b), .start = a, .end = b};
  for (auto& [image_id, image] : model->images) {
    line.track.push_back({image_id, static_cast<line2D_t>(image.lines2D.size())});
    image.lines2D.push_back({.segment = {{0, 0}, {1, 1}}, .line3D_id = id});
  }
  model->lines3D.Add(id, line);
  return id;
}

TEST(AddLinesToPlanes, TakesLinesWithBothEndsOnThePlaneAndItsExtent) {
  Reconstruction model = MakeCorner();
  const line3D_t on = AddLine({-1, 0, 10}, {1, 1, 10 + 1.9 * kGsd}, &model);
  const line3D_t edge = AddLine({2, -1, 10}, {2, 1, 10}, &model);
  AddLine({-1, 0, 10}, {1, 1, 10 + 2.2 * kGsd}, &model);  // one end off
  AddLine({-1, 3.5, 10}, {1, 3.5, 10}, &model);           // in the plane, where it is not
  AddLine({-1, 0, 11}, {1, 0, 11}, &model);               // behind it
  const PlaneMemberReport report = AddLinesToPlanes({}, &model);
  EXPECT_THAT(model.groups3D.at(1).line3D_ids, ElementsAre(on, edge));
  EXPECT_THAT(model.groups3D.at(2).line3D_ids, ElementsAre(edge));
  EXPECT_EQ(report.added, 3);
  EXPECT_EQ(report.features_on_planes, 2);
  EXPECT_THAT(report.dropped, UnorderedElementsAre(Pair("one end off the plane", 1),
                                                   Pair("away from the plane's points", 1)));
  EXPECT_EQ(model.FindInconsistency(), std::nullopt);
  // Once is enough.
  EXPECT_EQ(AddLinesToPlanes({}, &model).added, 0);
  EXPECT_EQ(AddLinesToPlanes({}, &model).features_on_planes, 2);
}

TEST(AddLinesToPlanes, HullCarriesALineAcrossAGapWithoutPoints) {
  Random random(2);
  Reconstruction model = MakeCameraRow(5, 1.0);
  Group3D frame{.type = FindGroupType("PLANE"), .params = {0, 0, 1, -10}};
  for (int i = 0; i < 40; ++i) {
    const double angle = 0.05 * 3.14159265358979 * i;
    frame.point3D_ids.push_back(
        AddPoint({3 * std::cos(angle), 3 * std::sin(angle), 10}, 0, &random, &model));
  }
  model.groups3D.Add(1, frame);
  AddLine({-0.5, 0, 10}, {0.5, 0, 10}, &model);
  AddLine({3.9, -2, 10}, {3.9, 2, 10}, &model);  // 63 px from the nearest, outside
  EXPECT_EQ(AddLinesToPlanes({}, &model).added, 1);
  EXPECT_THAT(model.groups3D.at(1).line3D_ids, ElementsAre(1));
}

TEST(AddLinesToPlanes, APlaneWithoutPointsAttractsNothing) {
  Random random(4);
  Reconstruction model = MakeCameraRow(5, 1.0);
  model.groups3D.Add(1, {.type = FindGroupType("PLANE"), .params = {0, 0, 1, -10}});
  AddLine({-1, 0, 10}, {1, 0, 10}, &model);
  AddPoint({0, 0, 10}, 0, &random, &model);
  EXPECT_EQ(AddLinesToPlanes({}, &model).added, 0);
  EXPECT_EQ(AddPointsToPlanes({}, {}, &model).added, 0);
}

TEST(AddPointsToPlanes, CornersBelongToBothPlanesAndSideBySidePlanesShareNothing) {
  Random random(3);
  Reconstruction model = MakeCorner();
  Group3D beside{.type = FindGroupType("PLANE"), .params = {0, 0, 1, -10 - 3 * kGsd}};
  beside.point3D_ids = model.groups3D.at(1).point3D_ids;
  for (size_t i = 0; i < 6; ++i) model.groups3D.at(1).point3D_ids.pop_back();
  model.groups3D.Add(3, {.type = beside.type,
                         .params = beside.params,
                         .point3D_ids = {beside.point3D_ids.end() - 6, beside.point3D_ids.end()}});
  const point3D_t corner = AddPoint({2, 0.1, 10}, 0, &random, &model);
  const point3D_t between = AddPoint({1.6, 1.9, 10 + 1.6 * kGsd}, 0, &random, &model);
  AddPoint({0.1, 0.1, 9}, 0, &random, &model);
  const std::vector<point3D_t> added = {corner, between, between, 9999};
  const PlaneMemberReport report = AddPointsToPlanes({}, added, &model);
  EXPECT_EQ(model.groups3D.at(1).point3D_ids.back(), corner);
  EXPECT_THAT(model.groups3D.at(2).point3D_ids.back(), corner);
  EXPECT_THAT(model.groups3D.at(3).point3D_ids.back(), between);
  EXPECT_EQ(report.added, 3);
  EXPECT_EQ(report.dropped.at("on a plane beside it"), 1);
}

TEST(AddLinesToPlanes, FindsTheLinesOnPlanesOfRealSets) {
  HOLBA_SKIP_WITHOUT_DATA();
  // What the study behind these methods found: lines of 4 or more images on planes.
  const std::pair<const char*, size_t> sets[] = {
      {"entry_p10", 234}, {"fountain_p11", 83}, {"southbuilding26", 209}, {"redkitchen40", 122}};
  for (const auto& [name, lines] : sets) {
    Reconstruction model = ReadModel(DataFolder() / name / "holistic");
    for (auto& [id, image] : model.images) image.groups2D.clear();
    model.groups3D = {};
    model.relations.clear();
    DetectPlanes({}, &model);
    PlaneMemberOptions options;
    options.min_line_images = 4;
    EXPECT_GE(AddLinesToPlanes(options, &model).features_on_planes, lines) << name;
    EXPECT_EQ(model.FindInconsistency(), std::nullopt);
  }
}

}  // namespace
}  // namespace holba
