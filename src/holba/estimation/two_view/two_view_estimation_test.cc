// SPDX-License-Identifier: BSD-3-Clause
#include "holba/estimation/two_view/two_view_estimation.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/LU>
#include <Eigen/SVD>
#include <cmath>

#include "holba/base/threads.h"
#include "holba/estimation/two_view/relative_pose.h"
#include "holba/estimation/two_view/two_view_testing.h"
#include "holba/estimation/two_view/watermark.h"

namespace holba {
namespace {

struct EstimatedPair {
  TestPair pair;
  TwoViewResult result;
};

TwoViewResult Estimate(const TestPair& pair, const TwoViewOptions& options = {},
                       bool is_calibrated = true) {
  const Keypoints keypoints1 = ToKeypoints(pair.pixels1), keypoints2 = ToKeypoints(pair.pixels2);
  return EstimateTwoView(options, {&pair.camera1, is_calibrated, &keypoints1},
                         {&pair.camera2, is_calibrated, &keypoints2},
                         EachWithItself(pair.pixels1.size()), false, 7);
}

size_t NumRight(const TestPair& pair, const TwoViewResult& result) {
  size_t count = 0;
  for (const auto& match : result.geometry.inlier_matches) count += match[0] < pair.num_right;
  return count;
}

class EveryCamera : public testing::TestWithParam<const char*> {};

TEST_P(EveryCamera, PoseAndMatchesAreFoundAmongWrongOnes) {
  for (uint64_t seed = 0; seed < 20; ++seed) {
    const TestPair pair = MakeTestPair(
        {.camera = GetParam(), .num_right = 150, .num_wrong = 150, .noise_px = 0.5, .seed = seed});
    const TwoViewResult result = Estimate(pair);
    ASSERT_EQ(result.geometry.config, TwoViewConfig::kCalibrated) << seed;
    EXPECT_GE(NumRight(pair, result), 147u);  // next to an epipole a line means little
    EXPECT_LT(result.geometry.inlier_matches.size(), 165u);
    ASSERT_TRUE(result.geometry.cam2_from_cam1);
    // An equirectangular pixel is 0.45 degrees.
    const double scale = std::string(GetParam()) == "PINHOLE" ? 1.0 : 5.0;
    EXPECT_LT(RotationErrorDeg(*result.geometry.cam2_from_cam1, pair.cam2_from_cam1), 0.3 * scale);
    EXPECT_LT(DirectionErrorDeg(*result.geometry.cam2_from_cam1, pair.cam2_from_cam1), 2.0 * scale)
        << seed;
    EXPECT_GT(result.median_angle_deg, 3.0);
  }
}

INSTANTIATE_TEST_SUITE_P(Cameras, EveryCamera,
                         testing::Values("PINHOLE", "SIMPLE_RADIAL", "OPENCV_FISHEYE",
                                         "EQUIRECTANGULAR"),
                         [](const auto& info) { return info.param; });

TEST(EstimateTwoView, WithoutNoiseTheTruthIsFoundExactly) {
  for (const char* camera : {"PINHOLE", "SIMPLE_RADIAL", "OPENCV_FISHEYE", "EQUIRECTANGULAR"}) {
    const TestPair pair = MakeTestPair({.camera = camera, .num_right = 60, .num_wrong = 20});
    const TwoViewResult result = Estimate(pair);
    ASSERT_TRUE(result.geometry.cam2_from_cam1) << camera;
    // Keypoints are single precision: 3e-5 px.
    EXPECT_LT(RotationErrorDeg(*result.geometry.cam2_from_cam1, pair.cam2_from_cam1), 1e-3);
    EXPECT_LT(DirectionErrorDeg(*result.geometry.cam2_from_cam1, pair.cam2_from_cam1), 1e-3);
  }
}

TEST(EstimateTwoView, MatricesHoldForPixelsOfTheMatches) {
  const TestPair pair = MakeTestPair({.num_right = 100, .num_wrong = 30});
  for (bool is_calibrated : {true, false}) {
    const TwoViewResult result = Estimate(pair, {}, is_calibrated);
    ASSERT_TRUE(result.geometry.F);
    EXPECT_EQ(result.geometry.E.has_value(), is_calibrated);
    double worst_px = 0.0;
    for (size_t i = 0; i < pair.num_right; ++i) {
      const Eigen::Vector3d line = *result.geometry.F * pair.pixels1[i].homogeneous();
      worst_px = std::max(
          worst_px, std::abs(line.dot(pair.pixels2[i].homogeneous())) / line.head<2>().norm());
    }
    EXPECT_LT(worst_px, 1e-2);
    EXPECT_NEAR(result.geometry.F->determinant(), 0.0, 1e-12);
  }
}

TEST(EstimateTwoView, UnknownCalibrationGivesAnUncalibratedPair) {
  for (uint64_t seed = 0; seed < 10; ++seed) {
    const TestPair pair =
        MakeTestPair({.num_right = 200, .num_wrong = 100, .noise_px = 0.5, .seed = seed});
    const TwoViewResult result = Estimate(pair, {}, false);
    EXPECT_EQ(result.geometry.config, TwoViewConfig::kUncalibrated);
    EXPECT_GE(NumRight(pair, result), 198u);
    EXPECT_FALSE(result.geometry.cam2_from_cam1);
  }
}

TEST(EstimateTwoView, AWrongFocalLengthIsNotBelieved) {
  TestPair pair = MakeTestPair({.num_right = 300, .noise_px = 0.3, .seed = 4});
  pair.camera1.params[0] = pair.camera1.params[1] = 2000.0;
  EXPECT_EQ(Estimate(pair).geometry.config, TwoViewConfig::kUncalibrated);
}

TEST(EstimateTwoView, APlaneIsPlanarWithItsPose) {
  for (uint64_t seed = 0; seed < 20; ++seed) {
    const TestPair pair = MakeTestPair(
        {.num_right = 150, .num_wrong = 100, .noise_px = 0.5, .planar = true, .seed = seed});
    const TwoViewResult result = Estimate(pair);
    ASSERT_EQ(result.geometry.config, TwoViewConfig::kPlanar) << seed;
    EXPECT_GE(NumRight(pair, result), 148u);
    ASSERT_TRUE(result.geometry.cam2_from_cam1);
    // One of the two poses of the plane, which the matches do not tell apart: both are essential
    // matrices of all of them.
    const MatchedRays rays(pair.camera1, pair.pixels1, pair.camera2, pair.pixels2);
    EXPECT_GE(InliersOf(TwoViewKind::kEssential, EssentialMatrix(*result.geometry.cam2_from_cam1),
                        rays, 4.0)
                  .size(),
              145u);
    // The homography holds for pixels.
    ASSERT_TRUE(result.geometry.H);
    const Eigen::Vector2d transferred =
        (*result.geometry.H * pair.pixels1[0].homogeneous()).hnormalized();
    EXPECT_LT((transferred - pair.pixels2[0]).norm(), 4.0);
  }
}

TEST(EstimateTwoView, ARotationIsPanoramicWithoutTranslation) {
  for (uint64_t seed = 0; seed < 10; ++seed) {
    const TestPair pair = MakeTestPair(
        {.num_right = 150, .num_wrong = 50, .noise_px = 0.5, .rotation = true, .seed = seed});
    const TwoViewResult result = Estimate(pair);
    ASSERT_EQ(result.geometry.config, TwoViewConfig::kPanoramic) << seed;
    ASSERT_TRUE(result.geometry.cam2_from_cam1);
    EXPECT_TRUE(result.geometry.cam2_from_cam1->translation.isZero(0.0));
    EXPECT_LT(RotationErrorDeg(*result.geometry.cam2_from_cam1, pair.cam2_from_cam1), 0.1);
  }
}

TEST(EstimateTwoView, ForwardMotionIsFound) {
  for (uint64_t seed = 0; seed < 20; ++seed) {
    const TestPair pair = MakeTestPair(
        {.num_right = 150, .num_wrong = 100, .noise_px = 0.5, .forward = true, .seed = seed});
    const TwoViewResult result = Estimate(pair);
    ASSERT_TRUE(result.geometry.cam2_from_cam1) << seed;
    EXPECT_GE(NumRight(pair, result), 148u);
    EXPECT_LT(DirectionErrorDeg(*result.geometry.cam2_from_cam1, pair.cam2_from_cam1), 2.0);
  }
}

TEST(EstimateTwoView, WrongMatchesAloneAreDegenerate) {
  for (uint64_t seed = 0; seed < 5; ++seed) {
    const TestPair pair = MakeTestPair({.num_right = 0, .num_wrong = 40, .seed = seed});
    const TwoViewResult result = Estimate(pair);
    EXPECT_EQ(result.geometry.config, TwoViewConfig::kDegenerate);
    EXPECT_EQ(result.failure, TwoViewFailure::kFewInliers);
    EXPECT_TRUE(result.geometry.inlier_matches.empty());
  }
}

TEST(EstimateTwoView, FewMatchesAreDegenerate) {
  for (size_t count : {0, 1, 5, 14}) {
    const TwoViewResult result = Estimate(MakeTestPair({.num_right = count}));
    EXPECT_EQ(result.geometry.config, TwoViewConfig::kDegenerate);
    EXPECT_EQ(result.failure, TwoViewFailure::kFewMatches);
  }
}

TEST(EstimateTwoView, MatchesOfOnePlaceAreDegenerate) {
  TestPair pair = MakeTestPair({.num_right = 50});
  for (auto& x : pair.pixels1) x = pair.pixels1[0];
  for (auto& x : pair.pixels2) x = pair.pixels2[0];
  EXPECT_EQ(Estimate(pair).geometry.config, TwoViewConfig::kDegenerate);
}

TEST(EstimateTwoView, TheSameSeedGivesTheSameBits) {
  const TestPair pair =
      MakeTestPair({.num_right = 80, .num_wrong = 160, .noise_px = 1.0, .seed = 5});
  const TwoViewResult first = Estimate(pair);
  std::vector<TwoViewResult> again(8);
  ParallelTasks(2, again.size(), [&](size_t i) { again[i] = Estimate(pair); });
  for (const TwoViewResult& result : again) {
    EXPECT_EQ(result.geometry.inlier_matches, first.geometry.inlier_matches);
    EXPECT_EQ(*result.geometry.E, *first.geometry.E);
    EXPECT_EQ(result.geometry.cam2_from_cam1->translation,
              first.geometry.cam2_from_cam1->translation);
  }
}

TEST(EstimateTwoView, TheBestMatchesFirstNeedFewSamples) {
  // 10 % right ones, at the head of the list.
  const TestPair pair =
      MakeTestPair({.num_right = 60, .num_wrong = 540, .noise_px = 0.5, .seed = 2});
  const MatchedRays rays(pair.camera1, pair.pixels1, pair.camera2, pair.pixels2);
  TwoViewRansacOptions options;
  options.min_inlier_ratio = 0.05;
  options.best_first = true;
  const auto fit = FitTwoView(TwoViewKind::kEssential, rays, options);
  ASSERT_TRUE(fit);
  EXPECT_GE(std::count_if(fit->inliers.begin(), fit->inliers.end(),
                          [&](uint32_t i) { return i < pair.num_right; }),
            58);
  EXPECT_LT(fit->num_samples, 200);
}

TEST(EstimateTwoView, MotionsOfTwoBodiesAreMultiple) {
  TestPair pair = MakeTestPair({.num_right = 150, .seed = 3});
  const TestPair other = MakeTestPair({.num_right = 100, .seed = 9});
  pair.pixels1.insert(pair.pixels1.end(), other.pixels1.begin(), other.pixels1.end());
  pair.pixels2.insert(pair.pixels2.end(), other.pixels2.begin(), other.pixels2.end());
  TwoViewOptions options;
  options.multiple_models = true;
  const TwoViewResult result = Estimate(pair, options);
  EXPECT_EQ(result.geometry.config, TwoViewConfig::kMultiple);
  EXPECT_GE(result.geometry.inlier_matches.size(), 245u);
  EXPECT_LE(result.geometry.inlier_matches.size(), 250u);
}

TEST(EstimateTwoView, AStampOnTheBorderIsAWatermark) {
  Random random(1);
  TestPair pair = MakeTestPair({.num_right = 0});
  for (int i = 0; i < 60; ++i) {
    const Eigen::Vector2d x(random.Uniform(5, 200), random.Uniform(560, 598));
    pair.pixels1.push_back(x);
    pair.pixels2.push_back(x + Eigen::Vector2d(3.0, -2.0));
  }
  EXPECT_EQ(Estimate(pair).geometry.config, TwoViewConfig::kWatermark);
  TwoViewOptions options;
  options.detect_watermark = false;
  EXPECT_NE(Estimate(pair, options).geometry.config, TwoViewConfig::kWatermark);
  // In the middle of the picture it is none.
  for (auto& x : pair.pixels1) x.y() -= 300;
  for (auto& x : pair.pixels2) x.y() -= 300;
  EXPECT_NE(Estimate(pair).geometry.config, TwoViewConfig::kWatermark);
  // Left out as matches that stand still.
  options.filter_stationary_matches = true;
  EXPECT_EQ(Estimate(pair, options).failure, TwoViewFailure::kFewMatches);
}

class EveryKind : public testing::TestWithParam<TwoViewKind> {};

// The normal equations, against differences of the gain.
TEST_P(EveryKind, TheGradientIsThatOfTheGain) {
  const TwoViewKind kind = GetParam();
  const TestPair pair = MakeTestPair({.camera = "SIMPLE_RADIAL",
                                      .num_right = 61,
                                      .noise_px = 1.0,
                                      .planar = kind == TwoViewKind::kHomography});
  const MatchedRays rays(pair.camera1, pair.pixels1, pair.camera2, pair.pixels2);
  TwoViewRansacOptions options;
  const auto fit = FitTwoView(kind, rays, options);
  ASSERT_TRUE(fit);
  // Away from the best one, where the gradient is 0.
  Eigen::Matrix<double, 3, 3, Eigen::RowMajor> M = fit->model;
  M(0, 1) += 1e-4;
  M(2, 0) -= 2e-4;
  const double max_error_px = 4.0;
  for (SimdTarget target :
       {SimdTarget::kScalar, SimdTarget::kVec128, SimdTarget::kVec256, SimdTarget::kVec512}) {
    if (!IsSupported(target)) continue;
    const SimdTarget before = CurrentSimdTarget();
    SetSimdTarget(target);
    MatrixNormalEquations normal;
    const Eigen::Matrix<double, 3, 3, Eigen::RowMajor> inverse = M.inverse();
    if (kind == TwoViewKind::kHomography) {
      HOLBA_SIMD_CHOOSE(HomographyNormal)
      (rays.Columns(), M.data(), inverse.data(), max_error_px, &normal);
    } else {
      HOLBA_SIMD_CHOOSE(EpipolarNormal)(rays.Columns(), M.data(), max_error_px, &normal);
    }
    EXPECT_NEAR(normal.gain, GainOf(kind, M, rays, max_error_px), 1e-9);
    for (int k = 0; k < 9; ++k) {
      const double h = 1e-7;
      auto plus = M, minus = M;
      plus.data()[k] += h;
      minus.data()[k] -= h;
      const double slope =
          (GainOf(kind, plus, rays, max_error_px) - GainOf(kind, minus, rays, max_error_px)) /
          (2 * h);
      // d gain / d r = -4 w r / R^2, homographies have half the sum of squares.
      const double expected = -4.0 / (max_error_px * max_error_px) * normal.g[k];
      EXPECT_NEAR(slope, expected, 1e-4 * std::abs(expected) + 1e-2) << k;
    }
    SetSimdTarget(before);
  }
}

TEST_P(EveryKind, AGainThatCannotBeBeatenIsSeen) {
  const TestPair pair = MakeTestPair({.num_right = 100, .num_wrong = 300, .noise_px = 1.0});
  const MatchedRays rays(pair.camera1, pair.pixels1, pair.camera2, pair.pixels2);
  Random random(2);
  for (int trial = 0; trial < 20; ++trial) {
    Eigen::Matrix3d M;
    for (int k = 0; k < 9; ++k) M(k / 3, k % 3) = random.Normal();
    const double gain = GainOf(GetParam(), M, rays, 4.0);
    EXPECT_EQ(GainOf(GetParam(), M, rays, 4.0, gain * 0.99 - 1e-9), gain);
    EXPECT_LT(GainOf(GetParam(), M, rays, 4.0, gain + 1.0), 0.0);
  }
}

TEST_P(EveryKind, RefinementNeverLowersTheGain) {
  for (uint64_t seed = 0; seed < 30; ++seed) {
    const TestPair pair = MakeTestPair({.num_right = 60,
                                        .num_wrong = 20,
                                        .noise_px = 1.0,
                                        .planar = GetParam() == TwoViewKind::kHomography,
                                        .seed = seed});
    const MatchedRays rays(pair.camera1, pair.pixels1, pair.camera2, pair.pixels2);
    TwoViewRansacOptions options;
    options.max_num_samples = options.min_num_samples = 20;
    const auto fit = FitTwoView(GetParam(), rays, options);
    if (!fit) continue;
    const RefinedModel again = RefineModel(GetParam(), fit->model, rays, 4.0, 50);
    EXPECT_GE(again.gain, GainOf(GetParam(), fit->model, rays, 4.0));
    EXPECT_NEAR(again.gain, GainOf(GetParam(), again.model, rays, 4.0), 1e-6);
    EXPECT_NEAR(again.model.norm(), 1.0, 1e-12);
  }
}

INSTANTIATE_TEST_SUITE_P(Kinds, EveryKind,
                         testing::Values(TwoViewKind::kEssential, TwoViewKind::kFundamental,
                                         TwoViewKind::kHomography));

}  // namespace
}  // namespace holba
