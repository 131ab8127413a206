// SPDX-License-Identifier: BSD-3-Clause
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <map>
#include <string>

#include "holba/io/database.h"
#include "holba/io/database_testing.h"

namespace holba {
namespace {

class DatabasePriors : public ::testing::Test {
 protected:
  void SetUp() override { std::filesystem::remove(path_); }
  void TearDown() override { std::filesystem::remove(path_); }

  const std::filesystem::path path_ =
      std::filesystem::path(::testing::TempDir()) / "holba_database_priors.db";
};

TEST_F(DatabasePriors, AreReadAsTheyWereWritten) {
  Database database(path_);
  AddImages(3, &database);
  PosePrior full, gravity;
  full.position = Eigen::Vector3d(47.376466666666669, 8.54, -12.5);
  full.system = PosePrior::System::kWgs84;
  full.gravity_in_cam = Eigen::Vector3d(0, -1, 0);
  gravity.gravity_in_cam = Eigen::Vector3d(1, 0, 0);
  database.WritePosePrior(1, 1, gravity);
  database.WritePosePrior(1, 1, full);  // replaces
  database.WritePosePrior(3, 1, gravity);
  const std::map<image_t, PosePrior> priors = database.ReadPosePriors();
  const PosePrior& read = priors.at(1);
  EXPECT_EQ(read.position, full.position);
  EXPECT_EQ(read.system, full.system);
  EXPECT_EQ(read.gravity_in_cam, full.gravity_in_cam);
  EXPECT_FALSE(priors.contains(2));
  EXPECT_FALSE(priors.at(3).position);
  EXPECT_EQ(priors.at(3).gravity_in_cam, gravity.gravity_in_cam);
  EXPECT_EQ(priors.at(3).system, PosePrior::System::kUndefined);
  EXPECT_EQ(database.Summarise().num_pose_priors, 2u);
}

TEST_F(DatabasePriors, ADatabaseWithoutTheirTableTakesNone) {
  Database database(path_);
  AddImages(1, &database);
  database.Execute("DROP TABLE pose_priors");
  for (const char* column : {"prior_tx", "prior_ty", "prior_tz"})
    database.Execute(std::string("ALTER TABLE images DROP COLUMN ") + column);
  PosePrior prior;
  prior.position = Eigen::Vector3d(1, 2, 3);
  database.WritePosePrior(1, 1, prior);
  EXPECT_TRUE(database.ReadPosePriors().empty());
  EXPECT_EQ(database.Summarise().num_pose_priors, 0u);
}

TEST_F(DatabasePriors, OlderVersionsOfTheTableAndOfTheImagesAreRead) {
  Database database(path_);
  AddImages(3, &database);
  // COLMAP 3.9 to 3.12.
  database.Execute("DROP TABLE pose_priors");
  database.Execute(
      "CREATE TABLE pose_priors(image_id INTEGER PRIMARY KEY, position BLOB, coordinate_system "
      "INTEGER, position_covariance BLOB)");
  // 1, 2, 3 and three times "not a number", as COLMAP writes them.
  database.Execute(
      "INSERT INTO pose_priors VALUES(2, x'000000000000f03f00000000000000400000000000000840', 0, "
      "NULL), (3, x'000000000000f87f000000000000f87f000000000000f87f', -1, NULL)");
  std::map<image_t, PosePrior> priors = database.ReadPosePriors();
  ASSERT_EQ(priors.size(), 1u);
  EXPECT_EQ(priors.at(2).position, Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ(priors.at(2).system, PosePrior::System::kWgs84);
  // Up to 3.8: columns of the images, which our databases have for its sake, too.
  database.Execute("DROP TABLE pose_priors");
  database.Execute(
      "UPDATE images SET prior_tx = 4, prior_ty = 5, prior_tz = 6.5 WHERE image_id = 3");
  priors = database.ReadPosePriors();
  ASSERT_EQ(priors.size(), 1u);
  EXPECT_EQ(priors.at(3).position, Eigen::Vector3d(4, 5, 6.5));
  EXPECT_EQ(priors.at(3).system, PosePrior::System::kUndefined);
}

TEST_F(DatabasePriors, ADatabaseIsRemovedOnlyWhileItHoldsNothing) {
  { Database database(path_); }
  RemoveEmptyDatabase(path_);
  EXPECT_FALSE(std::filesystem::exists(path_));
  {
    Database database(path_);
    AddImages(1, &database);
  }
  RemoveEmptyDatabase(path_);
  EXPECT_TRUE(std::filesystem::exists(path_));
}

TEST_F(DatabasePriors, ASummaryCountsWhatIsThere) {
  Database database(path_);
  AddImages(3, &database);
  {
    const DatabaseSummary empty = database.Summarise();
    ASSERT_EQ(empty.images.size(), 3u);
    EXPECT_FALSE(empty.images[0].num_keypoints);
    EXPECT_FALSE(empty.images[0].num_segments);
    EXPECT_EQ(empty.num_pairs_tried, 0u);
  }
  Keypoints keypoints;
  keypoints.data = {1, 2, 3, 4, 5, 6};
  for (const image_t id : {1u, 2u, 3u}) database.WriteKeypoints(id, keypoints);
  database.WriteDescriptors(2, {0, 128, std::vector<uint8_t>(3 * 128, 9)});
  const ImageFeatures features = RandomFeatures(1, 12);
  WriteAll(2, "settings", features, &database);
  database.WriteMatches(1, 2, {{0, 1}, {1, 2}});
  database.WriteMatches(1, 3, {});
  TwoViewGeometry geometry;
  geometry.config = TwoViewConfig::kPlanar;
  geometry.inlier_matches = {{0, 1}};
  database.WriteTwoViewGeometry(1, 2, geometry);
  database.WriteTwoViewGeometry(1, 3, {.config = TwoViewConfig::kDegenerate});
  database.WriteSegments(1, "settings", features.segments);
  database.WriteLineMatches(1, 2, "settings", {{0, 3, 0.5f}, {2, 2, 0.25f}});

  const DatabaseSummary summary = database.Summarise();
  EXPECT_EQ(summary.cameras.size(), 1u);
  EXPECT_EQ(summary.num_frames, 3u);
  EXPECT_EQ(summary.images[0].num_keypoints, 3u);
  EXPECT_FALSE(summary.images[0].num_descriptors);
  EXPECT_EQ(summary.images[1].num_descriptors, 3u);
  EXPECT_EQ(summary.images[1].num_segments, 12u);
  EXPECT_EQ(summary.images[1].num_corners, features.corners.size());
  EXPECT_EQ(summary.images[1].num_vanishing_points, features.vanishing_points.size());
  EXPECT_TRUE(summary.images[1].has_label_map);
  EXPECT_FALSE(summary.images[2].num_segments);
  EXPECT_EQ(summary.num_pairs_tried, 2u);
  EXPECT_EQ(summary.num_matched_pairs, 1u);
  EXPECT_EQ(summary.num_matches, 2u);
  EXPECT_EQ(summary.num_verified_pairs, 1u);
  EXPECT_EQ(summary.num_inliers, 1u);
  EXPECT_EQ(summary.num_of_config.at(TwoViewConfig::kPlanar), 1u);
  EXPECT_EQ(summary.num_of_config.at(TwoViewConfig::kDegenerate), 1u);
  EXPECT_EQ(summary.num_line_matched_pairs, 1u);
  EXPECT_EQ(summary.num_line_matches, 2u);
}

}  // namespace
}  // namespace holba
