// SPDX-License-Identifier: BSD-3-Clause
// Points of a wall with a pattern that is there several times: counts are those of the wall.
#include "holba/frontend/matching/repetition.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "holba/base/random.h"

namespace holba {
namespace {

// 40 points that are unlike all others, and 30 that look alike in threes: windows, 60 pixels apart.
// The second image is shifted along x, or (level = false) the windows are below each other.
class Wall {
 public:
  explicit Wall(bool level) {
    for (int i = 0; i < 40; ++i) AddPoint({random_.Uniform(0, 700), random_.Uniform(0, 500)}, i);
    for (int i = 0; i < 10; ++i) {
      const double x = 30.0 + 60.0 * i;
      for (int k = 0; k < 3; ++k) {
        AddPoint(level ? Eigen::Vector2d(100.0 + 60.0 * k, 20.0 + 45.0 * i)
                       : Eigen::Vector2d(x, 100.0 + 60.0 * k),
                 1000 + i);
      }
    }
    for (size_t i = 0; i < 40; ++i)
      inliers_.push_back({static_cast<point2D_t>(i), static_cast<point2D_t>(i)});
  }

  PairRepetition Measure(const GuidingGeometry& geometry) const {
    const PackedDescriptors d1(descriptors1_, 1000), d2(descriptors2_, 1000);
    return MeasureRepetition({}, geometry, FindNeighbours(d1, d2), d1, positions1_, d2, positions2_,
                             inliers_);
  }

  static GuidingGeometry Rows() {
    Eigen::Matrix3d F = Eigen::Matrix3d::Zero();
    F(1, 2) = -1.0;
    F(2, 1) = 1.0;
    return {.F = F};
  }
  static GuidingGeometry Shift() {
    Eigen::Matrix3d H = Eigen::Matrix3d::Identity();
    H(0, 2) = kShift;
    return {.H = H};
  }

 private:
  static constexpr double kShift = 25.0;

  void AddPoint(const Eigen::Vector2d& position, uint64_t looks) {
    positions1_.push_back(position);
    positions2_.push_back(position + Eigen::Vector2d(kShift, 0.0));
    for (Descriptors* descriptors : {&descriptors1_, &descriptors2_}) {
      Random random(looks);
      Eigen::VectorXd d(128);
      for (double& v : d) v = std::abs(random.Normal());
      d *= 512.0 / d.norm();
      for (const double v : d) descriptors->data.push_back(static_cast<uint8_t>(std::lround(v)));
    }
  }

  Random random_{3};
  Descriptors descriptors1_, descriptors2_;
  std::vector<std::optional<Eigen::Vector2d>> positions1_, positions2_;
  PointMatches inliers_;
};

TEST(Repetition, CountsWhatTheRatioTestRefuses) {
  const PairRepetition found = Wall(true).Measure(Wall::Rows());
  EXPECT_THAT(found.num_near, testing::ElementsAre(70, 70));
  EXPECT_THAT(found.num_repeated, testing::ElementsAre(30, 30));
  EXPECT_EQ(found.num_sampled, 30u);
  ASSERT_EQ(found.ratios.size(), 40u);
  // The inliers are alike to the last bit, and nothing else is near.
  for (const float ratio : found.ratios) EXPECT_LT(ratio, 0.1f);
}

TEST(Repetition, IsUndecidedAlongAnEpipolarLineAndDecidedAcross) {
  const PairRepetition along = Wall(true).Measure(Wall::Rows());
  EXPECT_EQ(along.num_agreeing, 30u);
  EXPECT_EQ(along.num_undecided, 30u);
  const PairRepetition across = Wall(false).Measure(Wall::Rows());
  EXPECT_EQ(across.num_agreeing, 30u);
  EXPECT_EQ(across.num_undecided, 0u);
  const PairRepetition plane = Wall(true).Measure(Wall::Shift());
  EXPECT_EQ(plane.num_agreeing, 30u);
  EXPECT_EQ(plane.num_undecided, 0u);
  EXPECT_FALSE(plane.band_px.has_value());
}

TEST(Repetition, TheBandIsHowFarInliersAreFromOneEpipolarLine) {
  Wall wall(true);
  const PairRepetition spread = wall.Measure(Wall::Rows());
  // 500 pixels evenly: half are within 125 of the middle one.
  EXPECT_NEAR((*spread.band_px)[0], 125.0, 40.0);
  EXPECT_NEAR((*spread.band_px)[0], (*spread.band_px)[1], 1e-9);
}

}  // namespace
}  // namespace holba
