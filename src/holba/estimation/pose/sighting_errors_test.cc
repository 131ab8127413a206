// SPDX-License-Identifier: BSD-3-Clause
#include "holba/estimation/pose/sighting_errors.h"

#include <gtest/gtest.h>

#include "holba/estimation/pose/gain.h"
#include "holba/estimation/pose/pose_evidence.h"
#include "holba/estimation/pose/pose_testing.h"
#include "holba/geometry/manifold.h"

namespace holba {
namespace {

using Eigen::Vector2d;

// Compares hand-written derivatives with central differences; error(pose, params, jacobian).
template <typename Error>
void ExpectDerivatives(const TestView& view, const Error& error) {
  const Rigid3d& pose = view.cam_from_world;
  const std::vector<double>& params = view.camera.params;
  SightingJacobian jacobian;
  Vector2d at;
  ASSERT_TRUE(error(pose, params, &at, &jacobian));
  const double h = 1e-6;
  const auto moved_pose = [&](int k, double step) {
    Eigen::Matrix<double, 6, 1> delta = Eigen::Matrix<double, 6, 1>::Zero();
    delta[k] = step;
    return Rigid3d{ExpRotation(delta.head<3>()) * pose.rotation,
                   pose.translation + delta.tail<3>()};
  };
  Vector2d plus, minus;
  for (int k = 0; k < 6; ++k) {
    ASSERT_TRUE(error(moved_pose(k, h), params, &plus, nullptr));
    ASSERT_TRUE(error(moved_pose(k, -h), params, &minus, nullptr));
    const Vector2d expected = (plus - minus) / (2.0 * h);
    const Vector2d found = jacobian.pose.col(k);
    EXPECT_LT((expected - found).norm(), 1e-4 * (1.0 + expected.norm())) << k;
  }
  const int n = view.camera.model->num_params;
  for (int k = 0; k < n; ++k) {
    std::vector<double> up = params, down = params;
    const double step = h * std::max(1.0, std::abs(params[k]));
    up[k] += step;
    down[k] -= step;
    ASSERT_TRUE(error(pose, up, &plus, nullptr));
    ASSERT_TRUE(error(pose, down, &minus, nullptr));
    const Vector2d expected = (plus - minus) / (2.0 * step);
    const Vector2d found(jacobian.params[k], jacobian.params[n + k]);
    EXPECT_LT((expected - found).norm(), 1e-4 * (1.0 + expected.norm())) << k;
  }
}

TEST(SightingErrors, DerivativesAreThoseOfDifferences) {
  for (const char* model : {"PINHOLE", "SIMPLE_RADIAL", "OPENCV", "OPENCV_FISHEYE"}) {
    const TestView view = MakeTestView({.camera = model,
                                        .num_points = 5,
                                        .num_lines = 5,
                                        .num_directions = 5,
                                        .noise_px = 2.0,
                                        .seed = 3});
    const CameraModel* camera = view.camera.model;
    for (PointSighting point : view.matches.points) {
      point.relative_sigma = 1.5;
      ExpectDerivatives(view, [&](const Rigid3d& pose, const std::vector<double>& params,
                                  Vector2d* error, SightingJacobian* jacobian) {
        return ErrorOf(PosedCamera(camera, params.data(), pose), point, error, jacobian);
      });
    }
    for (LineSighting line : view.matches.lines) {
      line.relative_sigma = 1.5;
      ExpectDerivatives(view, [&](const Rigid3d& pose, const std::vector<double>& params,
                                  Vector2d* error, SightingJacobian* jacobian) {
        return ErrorOf(PosedCamera(camera, params.data(), pose), line, error, jacobian);
      });
    }
    // Derivatives by the calibration hold at the pose that agrees.
    const IdealCalibration given = camera->ideal_calibration(view.camera.params.data());
    for (DirectionSighting direction : view.matches.directions) {
      direction.relative_sigma = 1.5;
      SightingJacobian jacobian;
      Vector2d at;
      ASSERT_TRUE(ErrorOf(PosedCamera(camera, view.camera.params.data(), view.cam_from_world),
                          given, direction, &at, &jacobian));
      EXPECT_LT(at.norm(), 1e-12);
      for (int k = 0; k < 4; ++k) {
        std::vector<double> up = view.camera.params;
        up[k] *= 1.0 + 1e-5;
        Vector2d moved;
        ASSERT_TRUE(ErrorOf(PosedCamera(camera, up.data(), view.cam_from_world), given, direction,
                            &moved, nullptr));
        const Vector2d slope(jacobian.params[k], jacobian.params[camera->num_params + k]);
        // The basis turns with the direction: lengths are compared.
        EXPECT_NEAR(moved.norm(), slope.norm() * 1e-5 * std::abs(view.camera.params[k]), 1e-8)
            << model << k;
        if (camera->num_params < 4) break;
      }
    }
  }
}

TEST(SightingErrors, ALineSeenBehindTheCameraHasNoError) {
  TestView view = MakeTestView({.num_lines = 10});
  for (LineSighting line : view.matches.lines) {
    const PosedCamera posed(view.camera.model, view.camera.params.data(), view.cam_from_world);
    Vector2d error;
    ASSERT_TRUE(ErrorOf(posed, line, &error, nullptr));
    EXPECT_LT(error.norm(), 1e-6);
    // Mirrored at the camera's centre it has the same image.
    PlueckerLine in_cam = Transform(view.cam_from_world, line.line);
    in_cam.moment = -in_cam.moment;
    line.line = Transform(view.cam_from_world.Inverse(), in_cam);
    EXPECT_FALSE(ErrorOf(posed, line, &error, nullptr));
  }
}

TEST(Gain, IsTheMeanOverThresholds) {
  const Gain gain(1.0, 17.0);
  EXPECT_NEAR(gain.Of(0.0), 1.0, 1e-12);
  EXPECT_EQ(gain.Of(17.0 * 17.0), 0.0);
  for (double e2 : {0.1, 0.9, 1.1, 5.0, 100.0, 280.0}) {
    double sum = 0.0;
    const int steps = 100000;
    for (int k = 0; k < steps; ++k) {
      const double R2 = std::exp((k + 0.5) / steps * std::log(289.0));
      if (e2 < R2) sum += (1.0 - e2 / R2) * (1.0 - e2 / R2) / steps;
    }
    EXPECT_NEAR(gain.Of(e2), sum, 1e-4) << e2;
    const double slope = (gain.Of(e2 + 1e-6) - gain.Of(e2 - 1e-6)) / 2e-6;
    EXPECT_NEAR(gain.Weight(e2) * gain.SlopeAtZero(), -slope, 1e-6) << e2;
  }
}

TEST(PoseEvidence, GainOfRaysIsThatOfPixelsWhereSightingsAgree) {
  for (const char* model : {"PINHOLE", "OPENCV_FISHEYE"}) {
    const TestView view = MakeTestView({.camera = model,
                                        .num_points = 37,
                                        .num_wrong_points = 20,
                                        .num_lines = 11,
                                        .num_directions = 3,
                                        .noise_px = 0.5,
                                        .direction_noise_rad = 0.01,
                                        .seed = 5});
    const PoseEvidence evidence(view.camera, view.matches);
    const ForEachKind<double> noise{1.0, 1.0, 0.004};
    const Gain gain(1.0, 17.0);
    const double fast = evidence.GainOf(view.cam_from_world, noise, gain, -1.0);
    const double exact =
        evidence.GainOf(view.cam_from_world, view.camera.params, noise, gain, -1.0);
    EXPECT_GT(exact, 35.0);  // of the 51 that are right
    EXPECT_NEAR(fast, exact, 0.5);
    EXPECT_EQ(evidence.GainOf(view.cam_from_world, noise, gain, fast + 1e-9), -1.0);
    EXPECT_EQ(evidence.GainOf(view.cam_from_world, noise, gain, fast - 1e-6), fast);
  }
}

}  // namespace
}  // namespace holba
