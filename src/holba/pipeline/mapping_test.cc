// SPDX-License-Identifier: BSD-3-Clause
#include "holba/pipeline/mapping.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "holba/io/database_testing.h"
#include "holba/io/test_models.h"

namespace holba {
namespace {

TEST(ReadMappingData, TakesTheStructureThatTheDatabaseHasWhoeverMadeIt) {
  const TestFolder folder;
  Database database(folder / "a.db");
  AddImages(2, &database);
  PointMatches matches;
  for (point2D_t k = 0; k < 20; ++k) matches.push_back({k, k});
  for (image_t id = 1; id <= 2; ++id) {
    Keypoints keypoints;
    for (int k = 0; k < 20; ++k) {
      keypoints.data.push_back(static_cast<float>(10 * k));
      keypoints.data.push_back(5.0f);
    }
    database.WriteKeypoints(id, keypoints);
    database.WriteSegments(id, "of another program", {{{0, 0}, {50, 0}}, {{0, 9}, {50, 9}}});
    // No detector would find this direction in these segments.
    database.WriteVanishingPoints(id, "of another program",
                                  {{{Eigen::Vector3d::UnitY(), 1}}, {-1, 0}});
  }
  TwoViewGeometry geometry;
  geometry.config = TwoViewConfig::kUncalibrated;
  geometry.F = Eigen::Matrix3d::Identity();
  geometry.inlier_matches = matches;
  database.WriteTwoViewGeometry(1, 2, geometry);
  database.WriteLineMatches(1, 2, "of a third program", {{0, 1, 0.2f}, {1, 0, 0.3f}});

  const MappingData data = ReadMappingData({}, {}, {}, nullptr, &database);
  for (image_t id = 1; id <= 2; ++id) {
    const ImageFeatures& features = data.input.features.at(id);
    EXPECT_EQ(features.segments.size(), 2u);
    ASSERT_EQ(features.vanishing_points.size(), 1u);
    EXPECT_EQ(features.vanishing_points[0].direction_in_cam, Eigen::Vector3d::UnitY());
    EXPECT_EQ(features.vp_of_segment, std::vector<int32_t>({-1, 0}));
  }
  ASSERT_EQ(data.input.graph.LineCorrespondencesOf(1, 0).size(), 1u);
  EXPECT_EQ(data.input.graph.LineCorrespondencesOf(1, 0)[0].line2D_idx, 1u);
  EXPECT_EQ(data.input.graph.NumLineMatches(1, 2), 2u);
}

}  // namespace
}  // namespace holba
