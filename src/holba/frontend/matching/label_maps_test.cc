// SPDX-License-Identifier: BSD-3-Clause
#include "holba/frontend/matching/label_maps.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "holba/base/random.h"

namespace holba {
namespace {

using testing::ElementsAre;

// A map whose label is 1 left of column x0, else 2.
LabelMap TwoHalves(int width, int height, int x0, const char* type1, const char* type2) {
  LabelMap map;
  map.width = width;
  map.height = height;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) map.labels.push_back(x < x0 ? 1 : 2);
  }
  map.types[1] = FindGroupType(type1);
  map.types[2] = FindGroupType(type2);
  return map;
}

TEST(DistanceToRim, IsThatToTheNearestPixelOfAnotherLabelLessOne) {
  // Against all pairs of pixels, for regions that touch along edges.
  Random random(5);
  LabelMap map;
  map.width = 23;
  map.height = 17;
  std::vector<Eigen::Vector3d> discs;
  for (int i = 0; i < 4; ++i) {
    discs.emplace_back(random.Uniform(0, 23), random.Uniform(0, 17), random.Uniform(3, 7));
  }
  for (int y = 0; y < map.height; ++y) {
    for (int x = 0; x < map.width; ++x) {
      uint16_t label = 0;
      for (size_t i = 0; i < discs.size(); ++i) {
        if (std::hypot(x - discs[i].x(), y - discs[i].y()) < discs[i].z()) {
          label = static_cast<uint16_t>(i + 1);
        }
      }
      map.labels.push_back(label);
    }
  }
  const std::vector<float> distance = DistanceToRim(map);
  const auto at = [&](int x, int y) { return static_cast<size_t>(y * map.width + x); };
  for (int y = 0; y < map.height; ++y) {
    for (int x = 0; x < map.width; ++x) {
      double to_rim = 1e9;  // nearest pixel with a neighbour of another label
      for (int v = 0; v < map.height; ++v) {
        for (int u = 0; u < map.width; ++u) {
          bool is_rim = false;
          for (const auto& [du, dv] : {std::pair(1, 0), {-1, 0}, {0, 1}, {0, -1}}) {
            const int a = u + du, b = v + dv;
            if (a < 0 || b < 0 || a >= map.width || b >= map.height) continue;
            is_rim |= map.labels[at(a, b)] != map.labels[at(u, v)];
          }
          if (is_rim) to_rim = std::min(to_rim, std::hypot(u - x, v - y));
        }
      }
      EXPECT_NEAR(distance[at(x, y)], to_rim, 1e-4) << x << " " << y;
    }
  }
}

TEST(DistanceToRim, AMapOfOneLabelHasNoRim) {
  LabelMap map;
  map.width = 5;
  map.height = 4;
  map.labels.assign(20, 3);
  for (const float distance : DistanceToRim(map)) EXPECT_GE(distance, 5.0f);
}

// The image is 800 x 600, so that margins are in its pixels; the map has half the size.
TEST(GroupsOfLabelMap, FeaturesJoinTheRegionThatTheyLieIn) {
  const LabelMap map = TwoHalves(400, 300, 200, "PLANE", "CYLINDER");
  Image image;
  // The rim is at 400. Map pixel 199 (398..400) is the plane's rim, 200 the cylinder's.
  for (const double x : {10.0, 390.0, 399.0, 401.0, 403.0, 409.0, 799.9, 800.1, -1.0}) {
    image.points2D.push_back({{x, 300.0}, kNoId});
  }
  const auto line = [&](double x1, double x2) {
    image.lines2D.push_back({{{x1, 100.0}, {x2, 120.0}}, kNoId});
  };
  line(100, 300);  // in the plane
  line(300, 403);  // just over the rim: 95 % of it are inside
  line(300, 450);  // 66 %
  line(500, 700);  // a cylinder takes no lines
  RegionGroupOptions options;
  options.flat_margin_px = 1.0;
  options.curved_margin_px = 4.0;
  const RegionGroups groups = GroupsOfLabelMap(map, image, 800, 600, options);
  EXPECT_THAT(groups.labels, ElementsAre(1, 2));
  ASSERT_EQ(groups.groups.size(), 2u);
  EXPECT_EQ(groups.groups[0].type->name, "PLANE");
  EXPECT_THAT(groups.groups[0].point2D_idxs, ElementsAre(0, 1));
  EXPECT_THAT(groups.groups[0].line2D_idxs, ElementsAre(0, 1));
  EXPECT_EQ(groups.groups[0].group3D_id, kNoId);
  EXPECT_EQ(groups.groups[1].type->name, "CYLINDER");
  // 2 pixels of the map: 200 and 201 are too close to the rim, 204 is not.
  EXPECT_THAT(groups.groups[1].point2D_idxs, ElementsAre(5, 6));
  EXPECT_TRUE(groups.groups[1].line2D_idxs.empty());
}

TEST(GroupsOfLabelMap, MarginsMeanTheSameAtEveryResolution) {
  const LabelMap small = TwoHalves(200, 150, 100, "SPHERE", "SPHERE");
  const LabelMap large = TwoHalves(1600, 1200, 800, "SPHERE", "SPHERE");
  RegionGroupOptions options;
  options.curved_margin_px = 40.0;
  Image image;
  for (int x = 0; x < 3200; x += 16) {
    if (std::abs(std::abs(x - 1600) - 160) < 32) continue;  // within a pixel of the small map
    image.points2D.push_back({{x + 8.0, 1000.0}, kNoId});
  }
  const RegionGroups a = GroupsOfLabelMap(small, image, 3200, 2400, options);
  const RegionGroups b = GroupsOfLabelMap(large, image, 3200, 2400, options);
  ASSERT_EQ(a.groups.size(), 2u);
  size_t num_members = 0;
  for (size_t i = 0; i < 2; ++i) {
    EXPECT_EQ(a.groups[i].point2D_idxs, b.groups[i].point2D_idxs);
    num_members += a.groups[i].point2D_idxs.size();
  }
  EXPECT_LT(num_members, image.points2D.size());
  EXPECT_GT(num_members, image.points2D.size() / 2);
}

TEST(GroupsOfLabelMap, RegionsWithoutTypeOrFeaturesGiveNone) {
  LabelMap map = TwoHalves(80, 60, 40, "PLANE", "PLANE");
  Image image;
  image.points2D.push_back({{10, 30}, kNoId});
  image.points2D.push_back({{70, 30}, kNoId});
  map.types.erase(2);
  RegionGroups groups = GroupsOfLabelMap(map, image, 80, 60, {});
  EXPECT_THAT(groups.labels, ElementsAre(1));
  EXPECT_TRUE(groups.dropped.empty());
  image.points2D.clear();
  groups = GroupsOfLabelMap(map, image, 80, 60, {});
  EXPECT_TRUE(groups.groups.empty());
  EXPECT_EQ(groups.dropped.at("no feature in the region"), 1u);
  EXPECT_TRUE(GroupsOfLabelMap(LabelMap(), image, 80, 60, {}).groups.empty());
}

}  // namespace
}  // namespace holba
