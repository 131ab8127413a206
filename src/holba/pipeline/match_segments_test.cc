// SPDX-License-Identifier: BSD-3-Clause
#include "holba/pipeline/match_segments.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "holba/base/random.h"

namespace holba {
namespace {

// Two pictures of a facade, shifted by 30 pixels: equal windows in a row, whose edges look alike,
// and points near them.
class MatchSegmentsTest : public testing::Test {
 protected:
  static constexpr int kNumWindows = 12;

  void SetUp() override {
    std::string name =
        (std::filesystem::path(testing::TempDir()) / "holba_segments_XXXXXX").string();
    folder_ = mkdtemp(name.data());
    Database database(folder_ / "database.db");
    const Camera camera{FindCameraModel("PINHOLE"), 800, 600, {700, 700, 400, 300}};
    database.AddCamera(1, {camera, true});
    TwoViewGeometry geometry;
    geometry.config = TwoViewConfig::kCalibrated;
    for (image_t id : {1, 2}) {
      const double shift = id == 1 ? 0.0 : 30.0;
      Random random(5);
      database.AddImage(id, {std::to_string(id) + ".jpg", 1});
      Keypoints keypoints;
      ImageFeatures features;
      for (int k = 0; k < kNumWindows; ++k) {
        const double x = 60.0 + 55.0 * k + shift;
        features.segments.push_back({{x, 200}, {x, 280}});
        for (int i = 0; i < 3; ++i) {
          keypoints.data.insert(keypoints.data.end(), {float(x + random.Uniform(-15, 15)),
                                                       float(random.Uniform(190, 290))});
        }
        // Alike, but for noise.
        Random noise(100 * id + k);
        Eigen::VectorXf d = Eigen::VectorXf::Ones(kSegmentDescriptorSize);
        for (float& v : d) v += float(noise.Normal(0.2));
        d.normalize();
        features.segment_descriptors.insert(features.segment_descriptors.end(), d.begin(), d.end());
      }
      database.WriteKeypoints(id, keypoints);
      database.WriteSegments(id, "test", features.segments);
      database.WriteSegmentDescriptors(id, "test", features.segment_descriptors);
    }
    for (point2D_t i = 0; i < 3 * kNumWindows; ++i) geometry.inlier_matches.push_back({i, i});
    database.WriteTwoViewGeometry(1, 2, geometry);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  std::filesystem::path folder_;
};

TEST_F(MatchSegmentsTest, PointsTellEqualEdgesApart) {
  Database database(folder_ / "database.db");
  const auto report = MatchSegmentsOfPairs({}, {{1, 2}}, 2, &database);
  EXPECT_EQ(report.num_pairs, 1u);
  EXPECT_EQ(report.pairs_reused, 0u);
  EXPECT_GE(report.num_mutual, 10u);
  EXPECT_GE(report.num_matches, report.num_mutual);
}

TEST_F(MatchSegmentsTest, ASecondRunReusesThem) {
  Database database(folder_ / "database.db");
  const auto first = MatchSegmentsOfPairs({}, {{1, 2}}, 1, &database);
  const auto second = MatchSegmentsOfPairs({}, {{1, 2}}, 2, &database);
  EXPECT_EQ(second.pairs_reused, 1u);
  EXPECT_EQ(second.num_matches, first.num_matches);
  // Other matches of points: they are made anew.
  TwoViewGeometry geometry = *database.ReadTwoViewGeometry(1, 2);
  geometry.inlier_matches.resize(20);
  database.WriteTwoViewGeometry(1, 2, geometry);
  EXPECT_EQ(MatchSegmentsOfPairs({}, {{1, 2}}, 1, &database).pairs_reused, 0u);
}

TEST_F(MatchSegmentsTest, TheEssentialMatrixDecidesWhereCalibrationsAreKnownElseTheFundamental) {
  Database database(folder_ / "database.db");
  const auto num_matches = [&](const TwoViewGeometry& geometry) {
    database.WriteTwoViewGeometry(1, 2, geometry);
    return MatchSegmentsOfPairs({}, {{1, 2}}, 1, &database).num_matches;
  };
  TwoViewGeometry geometry = *database.ReadTwoViewGeometry(1, 2);
  const size_t without = num_matches(geometry);
  // Matches lie 200 pixels lower: no segment can match; along the rows: all can.
  const auto level = [](double lower) {
    Eigen::Matrix3d F = Eigen::Matrix3d::Zero();
    F(1, 2) = -1.0;
    F(2, 1) = 1.0;
    F(2, 2) = lower;
    return F;
  };
  geometry.config = TwoViewConfig::kUncalibrated;
  geometry.F = level(200.0);
  EXPECT_EQ(num_matches(geometry), without);  // the cameras are calibrated, and there is no E
  geometry.E = level(200.0 / 700.0);
  EXPECT_EQ(num_matches(geometry), 0u);
  geometry.E = level(0.0);
  EXPECT_EQ(num_matches(geometry), without);
  database.Execute("UPDATE cameras SET prior_focal_length = 0");
  EXPECT_EQ(num_matches(geometry), 0u);
  geometry.F = level(0.0);
  EXPECT_EQ(num_matches(geometry), without);
}

TEST_F(MatchSegmentsTest, PairsWithoutGeometryOrSegmentsAreLeftOut) {
  Database database(folder_ / "database.db");
  database.AddImage(3, {"3.jpg", 1});
  EXPECT_EQ(MatchSegmentsOfPairs({}, {{1, 3}, {2, 3}}, 1, &database).num_pairs, 0u);
  database.WriteTwoViewGeometry(1, 2, {});
  EXPECT_EQ(MatchSegmentsOfPairs({}, {{1, 2}}, 1, &database).num_pairs, 0u);
}

}  // namespace
}  // namespace holba
