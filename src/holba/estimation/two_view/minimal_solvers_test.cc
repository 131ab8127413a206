// SPDX-License-Identifier: BSD-3-Clause
#include "holba/estimation/two_view/minimal_solvers.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/LU>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>

#include "holba/base/random.h"
#include "holba/estimation/two_view/relative_pose.h"
#include "holba/estimation/two_view/two_view_testing.h"

namespace holba {
namespace {

struct RayPairs {
  std::vector<Eigen::Vector3d> rays1, rays2;
};

RayPairs ToRays(const TestPair& pair, size_t count) {
  RayPairs rays;
  for (size_t i = 0; i < count; ++i) {
    rays.rays1.push_back(
        *pair.camera1.model->unproject(pair.camera1.params.data(), pair.pixels1[i]));
    rays.rays2.push_back(
        *pair.camera2.model->unproject(pair.camera2.params.data(), pair.pixels2[i]));
  }
  return rays;
}

double Distance(const Eigen::Matrix3d& a, const Eigen::Matrix3d& b) {
  return std::min((a / a.norm() - b / b.norm()).norm(), (a / a.norm() + b / b.norm()).norm());
}
double NearestDistance(const std::vector<Eigen::Matrix3d>& solutions,
                       const Eigen::Matrix3d& truth) {
  double nearest = INFINITY;
  for (const auto& M : solutions) nearest = std::min(nearest, Distance(M, truth));
  return nearest;
}
double WorstResidual(const Eigen::Matrix3d& M, const RayPairs& rays) {
  double worst = 0.0;
  for (size_t i = 0; i < rays.rays1.size(); ++i)
    worst = std::max(worst, std::abs(rays.rays2[i].dot(M * rays.rays1[i])));
  return worst;
}

struct Case {
  const char* name;
  bool planar, forward;
  const char* camera;
};
class Solvers : public testing::TestWithParam<Case> {
 protected:
  TestPair Pair(uint64_t seed) const {
    return MakeTestPair({.camera = GetParam().camera,
                         .num_right = 20,
                         .planar = GetParam().planar,
                         .forward = GetParam().forward,
                         .seed = seed});
  }
};

TEST_P(Solvers, TheTrueEssentialMatrixIsAmongTheSolutions) {
  std::vector<double> errors;
  for (uint64_t seed = 0; seed < 300; ++seed) {
    const TestPair pair = Pair(seed);
    const RayPairs rays = ToRays(pair, 5);
    std::vector<Eigen::Matrix3d> solutions;
    SolveEssential(rays.rays1, rays.rays2, &solutions);
    EXPECT_LE(solutions.size(), 10u);
    errors.push_back(NearestDistance(solutions, EssentialMatrix(pair.cam2_from_cam1)));
  }
  std::sort(errors.begin(), errors.end());
  EXPECT_LT(errors[150], 1e-11);
  // Some samples are nearly degenerate, more of them in planes.
  EXPECT_LT(errors[GetParam().planar ? 270 : 296], 1e-5);
}

TEST_P(Solvers, EverySolutionIsEssentialAndFitsItsSample) {
  std::vector<double> residuals, deviations;
  for (uint64_t seed = 0; seed < 200; ++seed) {
    const RayPairs rays = ToRays(Pair(seed), 5);
    std::vector<Eigen::Matrix3d> solutions;
    SolveEssential(rays.rays1, rays.rays2, &solutions);
    for (const Eigen::Matrix3d& E : solutions) {
      EXPECT_NEAR(E.norm(), 1.0, 1e-12);
      residuals.push_back(WorstResidual(E, rays));
      const Eigen::Vector3d s = Eigen::JacobiSVD<Eigen::Matrix3d>(E).singularValues();
      deviations.push_back(std::max(s[0] - s[1], s[2]));
    }
  }
  std::sort(residuals.begin(), residuals.end());
  std::sort(deviations.begin(), deviations.end());
  EXPECT_LT(residuals.back(), 1e-9);
  EXPECT_LT(deviations[deviations.size() / 2], 1e-10);
  EXPECT_LT(deviations[deviations.size() * 98 / 100], 1e-5);
}

TEST_P(Solvers, TheTrueFundamentalMatrixIsAmongTheSolutions) {
  if (GetParam().planar) GTEST_SKIP() << "a plane does not determine it";
  std::vector<double> errors;
  for (uint64_t seed = 0; seed < 300; ++seed) {
    const TestPair pair = Pair(seed);
    const RayPairs rays = ToRays(pair, 7);
    std::vector<Eigen::Matrix3d> solutions;
    SolveFundamental(rays.rays1, rays.rays2, &solutions);
    EXPECT_LE(solutions.size(), 3u);
    for (const Eigen::Matrix3d& F : solutions) EXPECT_NEAR(F.determinant(), 0.0, 1e-9);
    errors.push_back(NearestDistance(solutions, EssentialMatrix(pair.cam2_from_cam1)));
  }
  std::sort(errors.begin(), errors.end());
  EXPECT_LT(errors[150], 1e-10);
  EXPECT_LT(errors[294], 1e-4);
}

INSTANTIATE_TEST_SUITE_P(Scenes, Solvers,
                         testing::Values(Case{"general", false, false, "PINHOLE"},
                                         Case{"planar", true, false, "PINHOLE"},
                                         Case{"forward", false, true, "PINHOLE"},
                                         Case{"fisheye", false, false, "OPENCV_FISHEYE"},
                                         Case{"sphere", false, false, "EQUIRECTANGULAR"}),
                         [](const auto& info) { return info.param.name; });

TEST(SolveHomography, TheTrueHomographyIsFound) {
  for (uint64_t seed = 0; seed < 100; ++seed) {
    const TestPair pair = MakeTestPair({.num_right = 20, .planar = true, .seed = seed});
    const RayPairs rays = ToRays(pair, 20);
    std::vector<Eigen::Matrix3d> solutions;
    SolveHomography({rays.rays1.data(), 4}, {rays.rays2.data(), 4}, &solutions);
    ASSERT_EQ(solutions.size(), 1u) << seed;
    for (size_t i = 0; i < 20; ++i) {
      const Eigen::Vector3d transferred = (solutions[0] * rays.rays1[i]).normalized();
      EXPECT_LT((transferred - rays.rays2[i]).norm(), 1e-6) << seed;
    }
  }
}

TEST(MinimalSolvers, DegenerateMatchesHaveNoSolution) {
  const TestPair pair = MakeTestPair({.num_right = 10});
  RayPairs rays = ToRays(pair, 7);
  std::vector<Eigen::Matrix3d> solutions;
  // The same match twice.
  rays.rays1[4] = rays.rays1[3];
  rays.rays2[4] = rays.rays2[3];
  SolveEssential({rays.rays1.data(), 5}, {rays.rays2.data(), 5}, &solutions);
  SolveFundamental(rays.rays1, rays.rays2, &solutions);
  EXPECT_TRUE(solutions.empty());
  SolveHomography({rays.rays1.data() + 1, 4}, {rays.rays2.data() + 1, 4}, &solutions);
  EXPECT_TRUE(solutions.empty());
  // Three in a row.
  rays = ToRays(pair, 4);
  rays.rays1[2] = rays.rays1[0] + rays.rays1[1];
  SolveHomography(rays.rays1, rays.rays2, &solutions);
  EXPECT_TRUE(solutions.empty());
}

TEST(RelativePose, AnEssentialMatrixHasItsPoseAmongFour) {
  for (uint64_t seed = 0; seed < 50; ++seed) {
    const TestPair pair = MakeTestPair({.num_right = 30, .seed = seed});
    const auto poses = PosesOfEssential(EssentialMatrix(pair.cam2_from_cam1));
    ASSERT_EQ(poses.size(), 4u);
    const MatchedRays rays(pair.camera1, pair.pixels1, pair.camera2, pair.pixels2);
    std::vector<uint32_t> all(rays.size());
    for (uint32_t i = 0; i < all.size(); ++i) all[i] = i;
    const auto chosen = ChoosePose(poses, rays, all);
    ASSERT_TRUE(chosen);
    EXPECT_EQ(chosen->num_in_front, 30u);
    EXPECT_LT(RotationErrorDeg(chosen->cam2_from_cam1, pair.cam2_from_cam1), 1e-6);
    EXPECT_LT(DirectionErrorDeg(chosen->cam2_from_cam1, pair.cam2_from_cam1), 1e-6);
  }
}

TEST(RelativePose, AHomographyOfAPlaneHasItsPoseAmongFour) {
  for (uint64_t seed = 0; seed < 50; ++seed) {
    const TestPair pair = MakeTestPair({.num_right = 4, .planar = true, .seed = seed});
    const RayPairs rays = ToRays(pair, 4);
    std::vector<Eigen::Matrix3d> solutions;
    SolveHomography(rays.rays1, rays.rays2, &solutions);
    ASSERT_EQ(solutions.size(), 1u);
    double nearest = INFINITY;
    for (const Rigid3d& pose : PosesOfHomography(solutions[0])) {
      EXPECT_NEAR(pose.rotation.norm(), 1.0, 1e-9);
      nearest = std::min(nearest, RotationErrorDeg(pose, pair.cam2_from_cam1) +
                                      DirectionErrorDeg(pose, pair.cam2_from_cam1));
    }
    EXPECT_LT(nearest, 1e-4) << seed;
  }
}

TEST(RelativePose, ARotationIsAHomographyWithoutTranslation) {
  const Rigid3d rotation{ExpRotation({0.1, -0.2, 0.3}), Eigen::Vector3d::Zero()};
  const auto poses = PosesOfHomography(-2.5 * rotation.RotationMatrix());
  ASSERT_EQ(poses.size(), 1u);
  EXPECT_TRUE(poses[0].translation.isZero(0.0));
  EXPECT_LT(RotationErrorDeg(poses[0], rotation), 1e-6);
}

TEST(RelativePose, RaysMeetAtTheirPoint) {
  const Rigid3d pose{ExpRotation({0.1, 0.2, -0.1}), Eigen::Vector3d(1, 0, 0.2).normalized()};
  const Eigen::Vector3d X(0.3, -0.4, 5.0);
  const auto meeting = MeetRays(pose, X.normalized(), (pose * X).normalized());
  ASSERT_TRUE(meeting);
  EXPECT_NEAR(meeting->depth1, X.norm(), 1e-9);
  EXPECT_NEAR(meeting->depth2, (pose * X).norm(), 1e-9);
  EXPECT_FALSE(MeetRays(pose, X, pose.rotation * X));
}

}  // namespace
}  // namespace holba
