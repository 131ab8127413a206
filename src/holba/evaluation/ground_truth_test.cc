// SPDX-License-Identifier: BSD-3-Clause
#include "holba/evaluation/ground_truth.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "holba/base/check.h"
#include "holba/evaluation/test_scenes.h"
#include "holba/geometry/angle.h"

namespace holba {
namespace {

const GroupType* Type(const char* name) {
  const GroupType* type = FindGroupType(name);
  HOLBA_CHECK(type != nullptr);
  return type;
}

// 8 images, 12 points (1 to 4 on the plane z = 2, 5 to 8 on the unit sphere), 3 lines, and one
// group of each type.
Reconstruction Scene() {
  Random random(11);
  Reconstruction model = RandomCameras(8, &random);
  for (point3D_t id = 1; id <= 12; ++id) {
    Point3D point;
    point.xyz = RandomVector(&random);
    if (id <= 4) point.xyz.z() = 2.0;
    if (id > 4 && id <= 8) point.xyz.normalize();
    model.points3D.Add(id, point);
  }
  for (line3D_t id = 1; id <= 3; ++id) {
    Line3D line;
    line.start = RandomVector(&random);
    line.end = line.start + RandomVector(&random);
    line.line = PlueckerLine::FromPoints(line.start, line.end);
    model.lines3D.Add(id, line);
  }
  const std::vector<std::pair<const char*, std::vector<double>>> groups{
      {"VP", {0, 0, 1}},
      {"PLANE", {0, 0, 1, -2}},
      {"SPHERE", {0, 0, 0, 1}},
      {"CYLINDER", {0, 0, 1, 0, 0, 0, 0.5}},
      {"CONE", {0, 0, 0, 0, 0, 1, 0.4}},
      {"ELLIPSOID", {1, 0, 0, 0, 0, 0, 0, 1, 2, 3}},
      {"CUBOID", {1, 0, 0, 0, -1, -1, -1, -1, -1, -1}}};
  for (const auto& [name, params] : groups) {
    Group3D group;
    group.type = Type(name);
    group.params = params;
    if (group.type->name == "PLANE") group.point3D_ids = {1, 2, 3, 4};
    if (group.type->name == "SPHERE") group.point3D_ids = {5, 6, 7, 8};
    model.groups3D.Add(model.groups3D.size() + 1, group);
  }
  return model;
}

Group3D& GroupOf(Reconstruction* model, const char* name) {
  for (auto& [id, group] : model->groups3D) {
    if (group.type == Type(name)) return group;
  }
  HOLBA_CHECK(false);
  return model->groups3D.begin()->second;
}

TEST(CompareToTruth, FindsNoErrorsInTheTruthUnderAnySimilarity) {
  const Reconstruction truth = Scene();
  Random random(12);
  for (int trial = 0; trial < 5; ++trial) {
    const auto model = trial == 0 ? truth : Moved(truth, RandomSimilarity(&random));
    const auto errors = CompareToTruth(model, truth);
    ASSERT_TRUE(errors);
    ASSERT_TRUE(errors->plane_offset && errors->line_distance && errors->position);
    EXPECT_EQ(errors->rotation_deg->count, 8);
    EXPECT_EQ(errors->point->count, 12);
    EXPECT_EQ(errors->line_direction_deg->count, 3);
    EXPECT_EQ(errors->plane_normal_deg->count, 1);
    EXPECT_EQ(errors->groups.at("SPHERE surface").count, 4);
    EXPECT_EQ(errors->Named().size(), 2 * (7 + errors->groups.size()));
    for (const auto& [name, value] : errors->Named()) EXPECT_LT(value, 1e-5) << name;
  }
}

TEST(CompareToTruth, MeasuresTheSameErrorsInEveryFrameOfTheModel) {
  const Reconstruction truth = Scene();
  Random random(13);
  Reconstruction model = truth;
  for (auto& [id, image] : model.images) {
    image.cam_from_world.translation += 0.01 * RandomVector(&random);
    image.cam_from_world.rotation =
        ExpRotation(0.01 * RandomVector(&random)) * image.cam_from_world.rotation;
  }
  for (auto& [id, point] : model.points3D) point.xyz += 0.01 * RandomVector(&random);
  const auto expected = CompareToTruth(model, truth)->Named();
  for (int trial = 0; trial < 5; ++trial) {
    const auto errors = CompareToTruth(Moved(model, RandomSimilarity(&random)), truth)->Named();
    ASSERT_EQ(errors.size(), expected.size());
    for (size_t i = 0; i < errors.size(); ++i) {
      EXPECT_EQ(errors[i].first, expected[i].first);
      EXPECT_NEAR(errors[i].second, expected[i].second, 1e-5) << errors[i].first;
    }
  }
}

TEST(CompareToTruth, MeasuresKnownErrors) {
  const Reconstruction truth = Scene();
  Reconstruction model = truth;
  // One camera turned by 3 degrees about its centre, the first point 0.2 off.
  Rigid3d& pose = model.images.at(2).cam_from_world;
  pose = Rigid3d(ExpRotation({3.0 * kRadPerDeg, 0, 0}), Eigen::Vector3d::Zero()) * pose;
  model.points3D.at(1).xyz.y() += 0.2;
  // A line shifted by 0.3 across, another turned by 5 degrees about its midpoint, end points
  // reversed.
  Line3D& shifted = model.lines3D.at(1);
  const Eigen::Vector3d across = shifted.line.direction.unitOrthogonal();
  shifted.line =
      PlueckerLine::FromPointDirection(shifted.start + 0.3 * across, shifted.line.direction);
  Line3D& turned = model.lines3D.at(2);
  const Eigen::Vector3d axis = turned.line.direction.unitOrthogonal();
  turned.line = PlueckerLine::FromPointDirection(
      0.5 * (turned.start + turned.end),
      -(ExpRotation(5.0 * kRadPerDeg * axis) * turned.line.direction));
  // The plane 0.25 off, with its normal reversed; the groups by their own quantities.
  GroupOf(&model, "PLANE").params = {0, 0, -1, 2.25};
  GroupOf(&model, "VP").params = {0, std::sin(0.1), -std::cos(0.1)};
  GroupOf(&model, "SPHERE").params = {0, 0, 0.3, 1.1};
  GroupOf(&model, "CYLINDER").params = {0, 0.6, 0.8, 0, 0, 0, 0.75};
  GroupOf(&model, "CONE").params = {0, 0.4, 0, 0, 0, 1, 0.5};
  GroupOf(&model, "ELLIPSOID").params = {1, 0, 0, 0, 0, 0, 0, 3, 1, 2.5};

  const GroundTruthErrors errors = CompareToTruth(model, truth, Sim3d());
  EXPECT_NEAR(errors.rotation_deg->rms, 3.0 / std::sqrt(8.0), 1e-9);
  EXPECT_NEAR(errors.rotation_deg->max, 3.0, 1e-9);
  EXPECT_NEAR(errors.rotation_deg->median, 0.0, 1e-6);
  EXPECT_NEAR(errors.position->max, 0.0, 1e-12);
  EXPECT_NEAR(errors.point->rms, 0.2 / std::sqrt(12.0), 1e-12);
  EXPECT_NEAR(errors.line_direction_deg->max, 5.0, 1e-9);
  EXPECT_NEAR(errors.line_direction_deg->rms, 5.0 / std::sqrt(3.0), 1e-9);
  EXPECT_NEAR(errors.line_distance->max, 0.3, 1e-9);
  EXPECT_NEAR(errors.line_distance->median, 0.0, 1e-9);
  EXPECT_NEAR(errors.plane_normal_deg->rms, 0.0, 1e-9);
  EXPECT_NEAR(errors.plane_offset->rms, 0.25, 1e-12);
  EXPECT_NEAR(errors.groups.at("VP direction_deg").rms, 0.1 / kRadPerDeg, 1e-9);
  EXPECT_NEAR(errors.groups.at("SPHERE centre").rms, 0.3, 1e-12);
  EXPECT_NEAR(errors.groups.at("SPHERE radius").rms, 0.1, 1e-12);
  EXPECT_GT(errors.groups.at("SPHERE surface").rms, 0.01);
  EXPECT_NEAR(errors.groups.at("CYLINDER radius").rms, 0.25, 1e-12);
  EXPECT_NEAR(errors.groups.at("CYLINDER axis_deg").rms, std::acos(0.8) / kRadPerDeg, 1e-9);
  EXPECT_NEAR(errors.groups.at("CONE apex").rms, 0.4, 1e-12);
  EXPECT_NEAR(errors.groups.at("CONE half_angle_deg").rms, 0.1 / kRadPerDeg, 1e-9);
  EXPECT_NEAR(errors.groups.at("ELLIPSOID semi_axes").rms, 0.5, 1e-9);  // 1 2.5 3 against 1 2 3
}

TEST(CompareToTruth, LeavesEmptyWhatTheModelsDoNotShare) {
  const Reconstruction truth = Scene();
  Reconstruction model;
  model.images = truth.images;
  const auto errors = CompareToTruth(model, truth);
  ASSERT_TRUE(errors);
  EXPECT_TRUE(errors->rotation_deg);
  EXPECT_FALSE(errors->point || errors->line_direction_deg || errors->line_distance ||
               errors->plane_normal_deg || errors->plane_offset);
  EXPECT_TRUE(errors->groups.empty());
  std::vector<std::string> names;
  for (const auto& [name, value] : errors->Named()) names.push_back(name);
  EXPECT_THAT(names, ::testing::ElementsAre("rotation_rms_deg", "rotation_median_deg",
                                            "position_rms", "position_median"));
  EXPECT_FALSE(CompareToTruth(Reconstruction(), truth));
}

TEST(Summarise, GivesTheMomentsAndTheMedianOfTheMiddleTwo) {
  const std::vector<double> even{4, 1, 3, 2}, odd{5, 1, 3};
  EXPECT_DOUBLE_EQ(Summarise(even)->median, 2.5);
  EXPECT_DOUBLE_EQ(Summarise(odd)->median, 3.0);
  EXPECT_DOUBLE_EQ(Summarise(even)->mean, 2.5);
  EXPECT_DOUBLE_EQ(Summarise(even)->rms, std::sqrt(7.5));
  EXPECT_DOUBLE_EQ(Summarise(even)->max, 4.0);
  EXPECT_FALSE(Summarise({}));
}

}  // namespace
}  // namespace holba
