// SPDX-License-Identifier: BSD-3-Clause
#include "apps/map/position_alignment.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "holba/base/random.h"
#include "holba/geometry/earth.h"

namespace holba {
namespace {

using ::testing::HasSubstr;

// Cameras on a hill of 40 m by 30 m, in a frame and a unit of their own; `positions` are the true
// ones.
struct Hill {
  Reconstruction model;
  std::map<image_t, PosePrior> positions;
};
Hill MakeHill(double noise) {
  Hill hill;
  Random random(2);
  const Sim3d model_from_world{
      0.02, Eigen::Quaterniond(0.5, 0.1, -0.7, 0.3).normalized(), {1, 2, 3}};
  hill.model.cameras.Add(1, {FindCameraModel("SIMPLE_PINHOLE"), 640, 480, {500, 320, 240}});
  for (image_t id = 1; id <= 20; ++id) {
    const Eigen::Vector3d place(random.Uniform(-20, 20), random.Uniform(-15, 15),
                                random.Uniform(0, 5));
    Image image{.name = std::to_string(id), .camera_id = 1};
    image.cam_from_world.translation = -(model_from_world * place);
    hill.model.images.Add(id, image);
    const Eigen::Vector3d error(random.Normal(noise), random.Normal(noise), random.Normal(noise));
    hill.positions[id] = {place + error, PosePrior::System::kCartesian, std::nullopt};
  }
  hill.model.AddTrivialRigsAndFrames();
  return hill;
}

TEST(PositionAlignment, ExactPositionsAreReachedAndAWrongOneMovesNothing) {
  Hill hill = MakeHill(0.0);
  *hill.positions.at(7).position += Eigen::Vector3d(1e4, 0, 0);
  const auto result = AlignToPositions(hill.positions, &hill.model);
  ASSERT_TRUE(result);
  EXPECT_EQ(result->why_not, "");
  EXPECT_NEAR(result->scale, 50.0, 1e-6);
  EXPECT_EQ(result->num_left_out, 1u);
  EXPECT_EQ(hill.model.FindInconsistency(), std::nullopt);
  for (const auto& [id, prior] : hill.positions) {
    if (id == 7) continue;
    EXPECT_LT((hill.model.CameraCentre(id) - *prior.position).norm(), 1e-6);
  }
}

TEST(PositionAlignment, GpsBecomesEastNorthAndUpInMetres) {
  Hill hill = MakeHill(0.0);
  // A degree of latitude is 111 km, one of longitude at 60 degrees half of that.
  for (auto& [id, prior] : hill.positions) {
    const Eigen::Vector3d place = *prior.position;
    prior.position =
        Eigen::Vector3d(60.0 + place.y() / 111412.0, 10.0 + place.x() / 55800.0, 100.0 + place.z());
    prior.system = PosePrior::System::kWgs84;
  }
  const auto result = AlignToPositions(hill.positions, &hill.model);
  ASSERT_TRUE(result && result->origin);
  EXPECT_EQ(result->why_not, "");
  EXPECT_NEAR(result->scale, 50.0, 0.1);
  const Eigen::Vector3d before = *result->origin;
  for (const auto& [id, prior] : hill.positions) {
    const Eigen::Vector3d expected((prior.position->y() - before.y()) * 55800.0,
                                   (prior.position->x() - before.x()) * 111412.0,
                                   prior.position->z() - before.z());
    EXPECT_LT((hill.model.CameraCentre(id) - expected).norm(), 0.1);
  }
}

TEST(PositionAlignment, WhatThePositionsDoNotDetermineIsLeftAsItIs) {
  Hill inexact = MakeHill(10.0);
  const Eigen::Vector3d before = inexact.model.CameraCentre(1);
  auto result = AlignToPositions(inexact.positions, &inexact.model);
  ASSERT_TRUE(result);
  EXPECT_THAT(result->why_not, HasSubstr("too inexact"));
  EXPECT_EQ(inexact.model.CameraCentre(1), before);

  Hill line = MakeHill(0.0);
  for (auto& [id, prior] : line.positions) prior.position = Eigen::Vector3d(id, 2.0 * id, 0);
  result = AlignToPositions(line.positions, &line.model);
  ASSERT_TRUE(result);
  EXPECT_THAT(result->why_not, HasSubstr("on one line"));

  Hill few = MakeHill(0.0);
  while (few.positions.size() > 2) few.positions.erase(few.positions.begin());
  EXPECT_FALSE(AlignToPositions(few.positions, &few.model));
}

TEST(EarthCentred, AgreesWithPublishedCoordinates) {
  // The ellipsoid's semi-axes.
  EXPECT_NEAR((EarthCentred({0, 0, 0}) - Eigen::Vector3d(6378137, 0, 0)).norm(), 0, 1e-6);
  EXPECT_NEAR((EarthCentred({90, 0, 0}) - Eigen::Vector3d(0, 0, 6356752.314245)).norm(), 0, 1e-5);
  // Up is away from the ellipsoid.
  const Eigen::Vector3d place(47.3, 8.5, 400);
  const Eigen::Vector3d up =
      EastNorthUp(place) * (EarthCentred({47.3, 8.5, 401}) - EarthCentred(place));
  EXPECT_NEAR((up - Eigen::Vector3d::UnitZ()).norm(), 0, 1e-6);
}

}  // namespace
}  // namespace holba
