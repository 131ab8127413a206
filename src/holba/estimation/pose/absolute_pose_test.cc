// SPDX-License-Identifier: BSD-3-Clause
#include "holba/estimation/pose/absolute_pose.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <cmath>
#include <numeric>

#include "holba/estimation/pose/pose_testing.h"
#include "holba/estimation/pose/sighting_errors.h"

namespace holba {
namespace {

AbsolutePoseOptions Options(int min_num_inliers = 15) {
  AbsolutePoseOptions options;
  options.abs_pose_min_num_inliers = min_num_inliers;
  options.abs_pose_refine_focal_length = false;
  options.abs_pose_refine_extra_params = false;
  return options;
}

size_t NumRight(const std::vector<uint8_t>& flags, size_t num_right) {
  return static_cast<size_t>(std::count(flags.begin(), flags.begin() + num_right, 1));
}

class EveryCamera : public testing::TestWithParam<const char*> {};

TEST_P(EveryCamera, PoseIsFoundAmongWrongPoints) {
  for (uint64_t seed = 0; seed < 10; ++seed) {
    const TestView view = MakeTestView({.camera = GetParam(),
                                        .num_points = 60,
                                        .num_wrong_points = 120,
                                        .noise_px = 0.5,
                                        .seed = seed});
    const auto pose = EstimateAbsolutePose(Options(), view.camera, true, view.matches, seed);
    ASSERT_TRUE(pose) << seed;
    // An equirectangular pixel is 0.45 degrees.
    const double scale = std::string(GetParam()) == "EQUIRECTANGULAR" ? 6.0 : 1.0;
    EXPECT_LT(PoseRotationErrorDeg(pose->cam_from_world, view.cam_from_world), 0.1 * scale) << seed;
    EXPECT_LT(CentreError(pose->cam_from_world, view.cam_from_world), 0.02 * scale);
    EXPECT_GE(NumRight(pose->inliers.points, 60), 59u);
    EXPECT_LE(pose->num_inliers.points, 62u);
    EXPECT_NEAR(pose->noise_sigma.points, 0.5, 0.15);
    EXPECT_EQ(pose->params, view.camera.params);
  }
}

TEST_P(EveryCamera, WithoutNoiseTheTruthIsFoundExactly) {
  const TestView view =
      MakeTestView({.camera = GetParam(), .num_points = 40, .num_wrong_points = 40});
  const auto pose = EstimateAbsolutePose(Options(), view.camera, true, view.matches, 1);
  ASSERT_TRUE(pose);
  EXPECT_LT(PoseRotationErrorDeg(pose->cam_from_world, view.cam_from_world), 1e-6);
  EXPECT_LT(CentreError(pose->cam_from_world, view.cam_from_world), 1e-7);
}

INSTANTIATE_TEST_SUITE_P(Cameras, EveryCamera,
                         testing::Values("PINHOLE", "SIMPLE_RADIAL", "OPENCV", "OPENCV_FISHEYE",
                                         "EQUIRECTANGULAR"),
                         [](const auto& info) { return info.param; });

struct Mix {
  const char* name;
  size_t num_points, num_lines, num_directions;
};

class EveryMix : public testing::TestWithParam<Mix> {
 public:
  static TestViewOptions View(uint64_t seed) {
    const Mix mix = GetParam();
    TestViewOptions options;
    options.num_points = options.num_wrong_points = mix.num_points;
    options.num_lines = options.num_wrong_lines = mix.num_lines;
    options.num_directions = options.num_wrong_directions = mix.num_directions;
    options.noise_px = 0.5;
    options.direction_noise_rad = 0.003;
    options.seed = seed;
    return options;
  }
};

TEST_P(EveryMix, PoseIsFoundWithHalfOfEachKindWrong) {
  for (const char* camera : {"PINHOLE", "OPENCV"}) {
    for (uint64_t seed = 0; seed < 10; ++seed) {
      TestViewOptions options = View(seed);
      options.camera = camera;
      const TestView view = MakeTestView(options);
      const auto pose = EstimateAbsolutePose(Options(5), view.camera, true, view.matches, seed);
      ASSERT_TRUE(pose) << camera << seed;
      EXPECT_LT(PoseRotationErrorDeg(pose->cam_from_world, view.cam_from_world), 1.0) << seed;
      EXPECT_LT(CentreError(pose->cam_from_world, view.cam_from_world), 0.2) << seed;
      EXPECT_GE(NumRight(pose->inliers.lines, options.num_lines) + 2, options.num_lines);
      EXPECT_GE(NumRight(pose->inliers.directions, options.num_directions) + 1,
                options.num_directions);
    }
  }
}

TEST_P(EveryMix, FocalLengthIsFoundWithHalfOfEachKindWrong) {
  for (uint64_t seed = 0; seed < 5; ++seed) {
    TestViewOptions options = View(seed);
    options.noise_px = 0.2;
    options.direction_noise_rad = 0.001;
    options.camera = "SIMPLE_RADIAL";
    TestView view = MakeTestView(options);
    const double truth = view.camera.params[0];
    const IdealCalibration given = view.camera.model->ideal_calibration(view.camera.params.data());
    view.camera.params[0] *= 1.7;
    for (DirectionSighting& direction : view.matches.directions) {
      direction.direction_in_cam =
          UnderCalibration(direction.direction_in_cam, given,
                           view.camera.model->ideal_calibration(view.camera.params.data()));
    }
    const auto pose = EstimateAbsolutePose(Options(5), view.camera, false, view.matches, seed);
    ASSERT_TRUE(pose) << seed;
    EXPECT_NEAR(pose->params[0] / truth, 1.0, 0.05) << seed;
    EXPECT_LT(PoseRotationErrorDeg(pose->cam_from_world, view.cam_from_world), 2.0) << seed;
  }
}

INSTANTIATE_TEST_SUITE_P(Mixes, EveryMix,
                         testing::Values(Mix{"TenPointsTenLines", 10, 10, 0},
                                         Mix{"TwoPointsTwentyLines", 2, 20, 0},
                                         Mix{"TwentyLines", 0, 20, 0},
                                         Mix{"EightPointsThreeDirections", 8, 0, 3},
                                         Mix{"TenLinesThreeDirections", 0, 10, 3},
                                         Mix{"FourPointsSixLinesThreeDirections", 4, 6, 3}),
                         [](const auto& info) { return std::string(info.param.name); });

TEST(EstimateAbsolutePose, ADirectionCountsWithEitherSign) {
  TestView view = MakeTestView({.num_points = 20, .num_directions = 3});
  const auto pose = EstimateAbsolutePose(Options(), view.camera, true, view.matches, 1);
  for (DirectionSighting& direction : view.matches.directions) direction.direction_in_cam *= -1.0;
  const auto turned = EstimateAbsolutePose(Options(), view.camera, true, view.matches, 1);
  ASSERT_TRUE(pose && turned);
  EXPECT_EQ(pose->num_inliers.directions, 3u);
  EXPECT_EQ(turned->num_inliers.directions, 3u);
  EXPECT_LT(CentreError(pose->cam_from_world, turned->cam_from_world), 1e-6);
}

TEST(EstimateAbsolutePose, UnknownFocalLengthIsFoundFromAnyStart) {
  for (const char* model : {"SIMPLE_PINHOLE", "PINHOLE", "SIMPLE_RADIAL", "OPENCV_FISHEYE"}) {
    for (uint64_t seed = 0; seed < 5; ++seed) {
      TestView view = MakeTestView({.camera = model,
                                    .num_points = 60,
                                    .num_wrong_points = 60,
                                    .noise_px = 0.5,
                                    .seed = seed});
      const std::vector<double> truth = view.camera.params;
      for (int idx : view.camera.model->focal_idxs) view.camera.params[idx] *= 1.7;
      const auto pose = EstimateAbsolutePose(Options(), view.camera, false, view.matches, seed);
      ASSERT_TRUE(pose) << model << seed;
      EXPECT_NEAR(pose->params[0] / truth[0], 1.0, 0.02) << model << seed;
      EXPECT_LT(CentreError(pose->cam_from_world, view.cam_from_world), 0.15);
      EXPECT_GE(NumRight(pose->inliers.points, 60), 58u);
    }
  }
}

TEST(EstimateAbsolutePose, IntrinsicsAreRefinedWhereAsked) {
  TestView view = MakeTestView({.camera = "SIMPLE_RADIAL", .num_points = 400, .noise_px = 0.2});
  view.camera.params[0] = 730.0;
  view.camera.params[3] = 0.0;
  AbsolutePoseOptions options = Options();
  options.abs_pose_refine_focal_length = options.abs_pose_refine_extra_params = true;
  const auto pose = EstimateAbsolutePose(options, view.camera, true, view.matches, 1);
  ASSERT_TRUE(pose);
  EXPECT_NEAR(pose->params[0], 700.0, 3.0);
  EXPECT_NEAR(pose->params[3], -0.15, 0.01);
  EXPECT_EQ(pose->params[1], view.camera.params[1]);
  EXPECT_EQ(pose->params[2], view.camera.params[2]);
}

// Squared errors over the covariance are distributed like chi squared of 6.
TEST(EstimateAbsolutePose, CovarianceIsThatOfTheErrors) {
  double sum = 0.0;
  const int num_trials = 200;
  for (int trial = 0; trial < num_trials; ++trial) {
    const TestView view = MakeTestView({.num_points = 80,
                                        .num_wrong_points = 20,
                                        .noise_px = 1.0,
                                        .seed = static_cast<uint64_t>(trial)});
    const auto pose = EstimateAbsolutePose(Options(), view.camera, true, view.matches, 5);
    ASSERT_TRUE(pose);
    Vector6d error;
    error << LogRotation(pose->cam_from_world.rotation * view.cam_from_world.rotation.conjugate()),
        pose->cam_from_world.translation - view.cam_from_world.translation;
    sum += error.dot(pose->covariance.ldlt().solve(error));
  }
  EXPECT_NEAR(sum / num_trials, 6.0, 1.2);
}

TEST(EstimateAbsolutePose, WrongPointsAloneHaveNoPose) {
  int num_found = 0;
  for (uint64_t seed = 0; seed < 10; ++seed) {
    const TestView view = MakeTestView({.num_wrong_points = 200, .seed = seed});
    num_found += EstimateAbsolutePose(Options(), view.camera, true, view.matches, seed).has_value();
  }
  EXPECT_EQ(num_found, 0);
}

TEST(EstimateAbsolutePose, FewerSightingsThanUnknownsHaveNoPose) {
  for (size_t num_points : {0u, 1u, 2u, 3u}) {
    const TestView view = MakeTestView({.num_points = num_points});
    EXPECT_FALSE(EstimateAbsolutePose(Options(1), view.camera, true, view.matches, 1));
    EXPECT_FALSE(EstimateAbsolutePose(Options(1), view.camera, false, view.matches, 1));
  }
  const TestView view = MakeTestView({.num_points = 4});
  EXPECT_TRUE(EstimateAbsolutePose(Options(1), view.camera, true, view.matches, 1));
}

TEST(EstimateAbsolutePose, PointsBehindTheCameraDoNotCount) {
  TestView view = MakeTestView({.num_points = 40});
  for (size_t i = 0; i < 10; ++i) {
    PointSighting mirrored = view.matches.points[i];
    mirrored.X = view.cam_from_world.Inverse() * -(view.cam_from_world * mirrored.X);
    view.matches.points.push_back(mirrored);
  }
  const auto pose = EstimateAbsolutePose(Options(), view.camera, true, view.matches, 1);
  ASSERT_TRUE(pose);
  EXPECT_EQ(pose->num_inliers.points, 40u);
}

TEST(EstimateAbsolutePose, TheSameSeedGivesTheSameBits) {
  const TestView view = MakeTestView({.num_points = 50, .num_wrong_points = 100, .noise_px = 1.0});
  const auto a = EstimateAbsolutePose(Options(), view.camera, true, view.matches, 9);
  const auto b = EstimateAbsolutePose(Options(), view.camera, true, view.matches, 9);
  ASSERT_TRUE(a && b);
  EXPECT_EQ(a->cam_from_world.rotation.coeffs(), b->cam_from_world.rotation.coeffs());
  EXPECT_EQ(a->cam_from_world.translation, b->cam_from_world.translation);
  EXPECT_EQ(a->covariance, b->covariance);
}

}  // namespace
}  // namespace holba
