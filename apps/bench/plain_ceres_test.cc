// SPDX-License-Identifier: BSD-3-Clause
// The plain Ceres program solves what holba's problem says.
#include "apps/bench/plain_ceres.h"

#include <gtest/gtest.h>

#include <cmath>
#include <sstream>
#include <string>

#include "apps/bench/solver_problems.h"
#include "holba/base/random.h"
#include "holba/bundle/bundle_problem.h"
#include "holba/io/bal.h"

namespace holba {
namespace {

void RandomResidual(double angle, Random* random, double* camera, double* point,
                    Eigen::Vector2d* observed) {
  Eigen::Vector3d w(random->Normal(), random->Normal(), random->Normal());
  w *= angle / w.norm();
  for (int i = 0; i < 3; ++i) {
    camera[i] = w[i];
    camera[3 + i] = random->Normal() + (i == 2 ? 6.0 : 0.0);
    point[i] = random->Normal();
  }
  camera[6] = 700.0;
  camera[7] = random->Normal(0.1);
  camera[8] = random->Normal(0.1);
  *observed << random->Normal(100.0), random->Normal(100.0);
}

TEST(EvaluateBalResidual, IsTheSnavelyCamera) {
  Random random(1);
  for (const double angle : {0.0, 1e-9, 1e-4, 0.5, 3.0}) {
    double camera[9], point[3], residual[2];
    Eigen::Vector2d observed;
    RandomResidual(angle == 0.0 ? 1.0 : angle, &random, camera, point, &observed);
    if (angle == 0.0) camera[0] = camera[1] = camera[2] = 0.0;
    ASSERT_TRUE(EvaluateBalResidual(camera, point, observed, residual, nullptr, nullptr));
    const Eigen::Vector3d p = ExpRotation({camera[0], camera[1], camera[2]}) *
                                  Eigen::Vector3d(point[0], point[1], point[2]) +
                              Eigen::Vector3d(camera[3], camera[4], camera[5]);
    const double u = p.x() / p.z(), v = p.y() / p.z(), r2 = u * u + v * v;
    const double scale = camera[6] * (1.0 + camera[7] * r2 + camera[8] * r2 * r2);
    EXPECT_NEAR(residual[0], scale * u - observed.x(), 1e-9);
    EXPECT_NEAR(residual[1], scale * v - observed.y(), 1e-9);
  }
}

TEST(EvaluateBalResidual, HasTheJacobiansOfItsDifferences) {
  Random random(2);
  for (const double angle : {1e-9, 5e-4, 2e-3, 0.5, 2.0, 3.1}) {
    double values[12], residual[2], d_camera[18], d_point[6];
    Eigen::Vector2d observed;
    RandomResidual(angle, &random, values, values + 9, &observed);
    ASSERT_TRUE(EvaluateBalResidual(values, values + 9, observed, residual, d_camera, d_point));
    for (int i = 0; i < 12; ++i) {
      const double h = 1e-6, before = values[i];
      double above[2], below[2];
      values[i] = before + h;
      EvaluateBalResidual(values, values + 9, observed, above, nullptr, nullptr);
      values[i] = before - h;
      EvaluateBalResidual(values, values + 9, observed, below, nullptr, nullptr);
      values[i] = before;
      for (int k = 0; k < 2; ++k) {
        const double by_difference = (above[k] - below[k]) / (2 * h);
        const double ours = i < 9 ? d_camera[9 * k + i] : d_point[3 * k + i - 9];
        EXPECT_NEAR(ours, by_difference, 1e-6 * (100.0 + std::abs(by_difference)))
            << "angle " << angle << ", parameter " << i;
      }
    }
  }
}

// 4 cameras side by side that look along -z at 40 points, observations moved by a pixel.
Reconstruction SmallBalModel() {
  Random random(3);
  constexpr int kCameras = 4, kPoints = 40;
  std::ostringstream text;
  text.precision(17);
  text << kCameras << " " << kPoints << " " << kCameras * kPoints << "\n";
  double points[kPoints][3];
  for (auto& p : points) {
    p[0] = random.Uniform(-3, 3);
    p[1] = random.Uniform(-3, 3);
    p[2] = random.Uniform(-2, 2);
  }
  for (int c = 0; c < kCameras; ++c) {
    for (int i = 0; i < kPoints; ++i) {
      const double z = points[i][2] - 10.0, x = points[i][0] - c, y = points[i][1];
      text << c << " " << i << " " << -500.0 * x / z + random.Normal() << " "
           << -500.0 * y / z + random.Normal() << "\n";
    }
  }
  for (int c = 0; c < kCameras; ++c) {
    text << "0.001 0.002 " << 0.001 * c << " " << -c + 0.05 << " 0.02 -10 495 0 0\n";
  }
  for (const auto& p : points) text << p[0] << " " << p[1] << " " << p[2] + 0.05 << "\n";
  return ParseBal(text.str(), "small");
}

TEST(SolveBalWithPlainCeres, FindsTheCostOfTheBackendCeres) {
  const Reconstruction model = SmallBalModel();
  ASSERT_TRUE(IsBalModel(model));
  BundleOptions bundle_options;
  bundle_options.config = BundleConfig::kPoint;
  bundle_options.gauge = Gauge::kFree;
  bundle_options.SetDefaultLosses(true);
  SolverOptions options;
  options.backend = Backend::kCeres;
  options.function_tolerance = 1e-12;
  options.num_threads = 1;
  options.eta = 1e-8;  // the iterative ones, too
  for (const LinearSolver linear : {LinearSolver::kAuto, LinearSolver::kDense,
                                    LinearSolver::kSparse, LinearSolver::kIterative}) {
    options.linear_solver = linear;
    BundleProblem bundle = BuildProblem(model, bundle_options);
    const SolverSummary ours = Solve(options, &bundle.problem);
    const SolverSummary plain = SolveBalWithPlainCeres(options, model);
    EXPECT_NEAR(plain.initial_cost, ours.initial_cost, 1e-9 * ours.initial_cost);
    EXPECT_NEAR(plain.final_cost, ours.final_cost, 1e-6 * ours.final_cost) << plain.linear_solver;
    EXPECT_GT(plain.iterations, 2);
    EXPECT_EQ(plain.iteration_seconds.size(), static_cast<size_t>(plain.iterations));
  }
}

TEST(IsBalModel, IsFalseForOtherCameras) {
  Reconstruction model = SmallBalModel();
  model.cameras.at(1).params[1] = 0.5;
  EXPECT_FALSE(IsBalModel(model));
}

}  // namespace
}  // namespace holba
