// SPDX-License-Identifier: BSD-3-Clause
#include "holba/estimation/groups/plane_split.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <set>

#include "holba/estimation/points/point_scene_testing.h"
#include "holba/group/known_types.h"

namespace holba {
namespace {

using testing::SizeIs;

constexpr double kNoisePx = 0.3;

std::vector<point3D_t> AddWall(double depth, double left, double right, int count, Random* random,
                               Reconstruction* model) {
  std::vector<point3D_t> ids;
  for (int i = 0; i < count; ++i) {
    ids.push_back(AddPoint({random->Uniform(left, right), random->Uniform(-3, 3), depth}, kNoisePx,
                           random, model));
  }
  return ids;
}

std::vector<double> Offsets(const Reconstruction& model) {
  std::vector<double> offsets;
  for (const auto& [id, group] : model.groups3D)
    offsets.push_back(std::abs(group.params[3] / group.params[2]));
  return offsets;
}

TEST(SplitPlanes, FrontsSideBySideThatAreALittleApartBecomeTwo) {
  Random random(1);
  Reconstruction model = MakeCameraRow(6, 1.0);
  // Depths are known to 0.01 or so.
  std::vector<point3D_t> members = AddWall(10.0, -3.0, 0.0, 200, &random, &model);
  const std::vector<point3D_t> right = AddWall(10.03, 0.0, 3.0, 120, &random, &model);
  members.insert(members.end(), right.begin(), right.end());
  const group3D_t id = model.AddGroup3D(PlaneType(), {0.0, 0.0, 1.0, -10.01}, members);
  EXPECT_EQ(SplitPlanes({}, kNoisePx, &model), 1u);
  ASSERT_THAT(model.groups3D, SizeIs(2));
  EXPECT_TRUE(model.groups3D.contains(id)) << "the larger part keeps it";
  const std::vector<double> offsets = Offsets(model);
  EXPECT_NEAR(offsets[0], 10.0, 0.005);
  EXPECT_NEAR(offsets[1], 10.03, 0.005);
  // Of a neighbourhood of 13 points the noise tells the side but for those along the border.
  const std::set<point3D_t> of_right(right.begin(), right.end());
  size_t num_wrong = 0;
  for (const point3D_t point_id : model.groups3D.at(id).point3D_ids)
    num_wrong += of_right.contains(point_id);
  EXPECT_LE(num_wrong, 12u);
  EXPECT_EQ(model.groups3D.begin()->second.point3D_ids.size() +
                std::next(model.groups3D.begin())->second.point3D_ids.size(),
            320u);
  EXPECT_EQ(model.FindInconsistency(), std::nullopt);
}

TEST(SplitPlanes, OneWallStaysOneWhateverItsNoise) {
  for (uint64_t seed = 0; seed < 20; ++seed) {
    Random random(seed);
    Reconstruction model = MakeCameraRow(6, 1.0);
    const std::vector<point3D_t> members = AddWall(10.0, -3.0, 3.0, 300, &random, &model);
    model.AddGroup3D(PlaneType(), {0.0, 0.0, 1.0, -10.0}, members);
    EXPECT_EQ(SplitPlanes({}, kNoisePx, &model), 0u);
    EXPECT_THAT(model.groups3D.begin()->second.point3D_ids, testing::ElementsAreArray(members));
  }
}

TEST(SplitPlanes, RecessedWindowsArePartedFromTheirWall) {
  Random random(2);
  Reconstruction model = MakeCameraRow(6, 1.0);
  std::vector<point3D_t> members;
  for (int i = 0; i < 900; ++i) {
    const double x = random.Uniform(-3, 3), y = random.Uniform(-3, 3);
    // Two rows of two windows, 1.6 wide and high.
    const bool is_window = std::abs(std::abs(x) - 1.5) < 0.8 && std::abs(std::abs(y) - 1.5) < 0.8;
    members.push_back(AddPoint({x, y, is_window ? 10.06 : 10.0}, kNoisePx, &random, &model));
  }
  model.AddGroup3D(PlaneType(), {0.0, 0.0, 1.0, -10.02}, members);
  EXPECT_EQ(SplitPlanes({}, kNoisePx, &model), 1u);
  const std::vector<double> offsets = Offsets(model);
  ASSERT_THAT(offsets, SizeIs(2));
  EXPECT_NEAR(offsets[0], 10.0, 0.01);
  EXPECT_NEAR(offsets[1], 10.06, 0.01);
}

}  // namespace
}  // namespace holba
