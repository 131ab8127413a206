// SPDX-License-Identifier: BSD-3-Clause
#include "apps/bench/timing.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

namespace holba {
namespace {

using ::testing::ElementsAre;
using ::testing::SizeIs;

// 6 per image less the gauge of 7, 3 per plane (one for 5 images), 4 per line in the wireframe
// where that is in 3D (all N lines have incidences).
constexpr size_t kPoses10 = 6 * 10 - 7, kPlanes10 = 3 * 2, kLines10 = 4 * 10;

TimingOptions SmallOptions() {
  TimingOptions options;
  options.num_images = {10};
  options.linear_solvers = {LinearSolver::kSparse, LinearSolver::kDense};
  options.iterations = 4;
  options.repetitions = 2;
  options.solver.num_threads = 1;
  return options;
}

BundleOptions KnownIntrinsics() {
  BundleOptions bundle;
  bundle.refine_focal_length = bundle.refine_extra_params = false;
  return bundle;
}

TEST(TimeIterations, TimesEveryConfigurationWithBothSolvers) {
  const std::vector<TimingCase> cases = ConfigCases(KnownIntrinsics());
  const TimingOptions options = SmallOptions();
  const std::vector<Timing> timings = TimeIterations(options, cases);
  ASSERT_THAT(timings, SizeIs(8));
  for (size_t i = 0; i < timings.size(); ++i) {
    const Timing& timing = timings[i];
    EXPECT_EQ(timing.name, cases[i % 4].name);
    EXPECT_EQ(timing.reduced_system.size, kPoses10 + (i % 4 >= 2 ? kPlanes10 : 0));
    EXPECT_TRUE(timing.used_solver.starts_with(i < 4 ? "sparse" : "dense"));
    EXPECT_EQ(timing.iterations, 4);
    EXPECT_GT(timing.seconds_per_iteration, 0.0);
    EXPECT_LT(timing.seconds_per_iteration, 1e3);
    if (i % 4 > 0) {
      EXPECT_GT(timing.num_residuals, timings[i - 1].num_residuals);
    }
  }
}

TEST(TimingReport, FitsTheExponentOfAPowerLawAndTheRatiosOfItsFactors) {
  // 2e-6 n^1.5 s, and three times that; the second seed takes twice as long throughout.
  TimingOptions options;
  options.num_images = {100, 200, 800};
  options.linear_solvers = {LinearSolver::kSparse, LinearSolver::kDense};
  options.scene.seed = 7;
  const std::vector<TimingCase> cases = {{"Point", {}}, {"Holistic", {}}};
  std::vector<std::vector<Timing>> of_seeds(2);
  for (int seed = 0; seed < 2; ++seed) {
    for (const int n : options.num_images) {
      for (const LinearSolver solver : options.linear_solvers) {
        for (int c = 0; c < 2; ++c) {
          Timing timing;
          timing.num_images = n;
          timing.linear_solver = solver;
          timing.name = cases[c].name;
          timing.seconds_per_iteration = 2e-6 * (seed + 1) * (2 * c + 1) *
                                         std::pow(n, solver == LinearSolver::kSparse ? 1.5 : 2.75);
          timing.reduced_system = {.size = static_cast<size_t>(6 * n - 7 + c), .density = 0.25};
          of_seeds[seed].push_back(timing);
        }
      }
    }
  }
  const PaperBenchReport report = TimingReport("scaling", options, cases, of_seeds);
  ASSERT_THAT(report.tables, SizeIs(4));
  const SeedTable& times = report.tables[0];
  EXPECT_THAT(times.cases, ElementsAre("7", "8"));
  EXPECT_THAT(times.rows,
              ElementsAre("Point, sparse", "Holistic, sparse", "Point, dense", "Holistic, dense"));
  EXPECT_NEAR(times.values[0][0][0], 2.0, 1e-9);
  const size_t exponent = times.MeasureOf("exponent").value();
  for (size_t r = 0; r < 4; ++r) {
    for (size_t s = 0; s < 2; ++s) {
      EXPECT_NEAR(times.values[r][exponent][s], r < 2 ? 1.5 : 2.75, 1e-12);
      EXPECT_NEAR(report.tables[1].values[r][2][s], r % 2 == 0 ? 1.0 : 3.0, 1e-12);
    }
  }
  EXPECT_EQ(report.tables[2].values[1][0][0], 594.0);
  EXPECT_EQ(report.tables[3].values[0][0][0], 25.0);
}

TEST(TimeIterations, KeepsTheLinesOfA3dWireframe) {
  const std::vector<Timing> timings =
      TimeIterations(SmallOptions(), WireframeFormCases(KnownIntrinsics()));
  ASSERT_THAT(timings, SizeIs(4));
  for (size_t i = 0; i < timings.size(); ++i) {
    EXPECT_EQ(timings[i].reduced_system.size, kPoses10 + kPlanes10 + (i % 2 == 1 ? kLines10 : 0));
  }
}

TEST(TimeIterations, RunsAllIterationsAlsoBeyondConvergence) {
  // Almost without noise: a run cannot go on for 60 iterations.
  TimingOptions options = SmallOptions();
  options.linear_solvers = {LinearSolver::kDense};
  options.scene.rotation_noise_deg = 1e-3;
  options.scene.translation_noise = options.scene.feature_noise = 1e-6;
  options.scene.observation_noise_px = 0.0;
  options.iterations = 60;
  options.repetitions = 1;
  const std::vector<TimingCase> point = {ConfigCases(KnownIntrinsics())[0]};
  const Timing timing = TimeIterations(options, point).at(0);
  EXPECT_EQ(timing.iterations, 60);
  EXPECT_GT(timing.seconds_per_iteration, 0.0);
}

}  // namespace
}  // namespace holba
