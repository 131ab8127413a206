// SPDX-License-Identifier: BSD-3-Clause
#include "holba/estimation/points/point_triangulation.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/LU>

#include "holba/base/random.h"
#include "holba/estimation/points/wireframe_testing.h"
#include "holba/scene/views.h"

namespace holba {
namespace {

using ::testing::ElementsAre;

class PointTriangulationTest : public ::testing::Test {
 protected:
  void Make(int num_images, const Eigen::Vector3d& X, std::string_view camera_model = "PINHOLE") {
    model_ = ArcOfCameras(num_images, camera_model);
    views_ = ViewMap(model_);
    seen_.clear();
    for (const IdealView& view : views_) seen_.push_back({&view, *view.Project(X)});
  }

  Reconstruction model_;
  ViewMap views_;
  std::vector<PointView> seen_;
};

TEST_F(PointTriangulationTest, ExactObservationsGiveThePoint) {
  const Eigen::Vector3d X(0.4, -0.3, 0.9);
  for (int num_images : {2, 3, 10}) {
    Make(num_images, X);
    const auto point = TriangulatePoint(seen_, {});
    ASSERT_TRUE(point.has_value());
    EXPECT_LT((point->xyz - X).norm(), 1e-9);
    EXPECT_EQ(point->num_inliers, seen_.size());
    EXPECT_LT(point->rms_error_px, 1e-7);
    const Eigen::Vector3d first = X - views_[0].centre();
    const Eigen::Vector3d last = X - views_[views_.size() - 1].centre();
    EXPECT_NEAR(point->max_angle_rad, std::acos(first.normalized().dot(last.normalized())), 0.05);
  }
}

TEST_F(PointTriangulationTest, WrongObservationsAreOutliersAndDoNotMoveThePoint) {
  const Eigen::Vector3d X(0.4, -0.3, 0.9);
  Make(14, X);  // more pairs than samples
  for (size_t i : {1u, 4u, 6u, 9u, 13u}) {
    seen_[i].ideal += Eigen::Vector2d(7.0 * (i % 3) + 5.0, -30.0 + 11.0 * i);
  }
  const auto point = TriangulatePoint(seen_, {});
  ASSERT_TRUE(point.has_value());
  EXPECT_LT((point->xyz - X).norm(), 1e-9);
  EXPECT_EQ(point->num_inliers, 9u);
  EXPECT_THAT(point->is_inlier, ElementsAre(true, false, true, true, false, true, false, true, true,
                                            false, true, true, true, false));
}

TEST_F(PointTriangulationTest, TheErrorIsThatOfTheCovariance) {
  // Mahalanobis distances of 300 noisy points have mean 3: a chi-square of 3 degrees of freedom.
  const Eigen::Vector3d X(0.4, -0.3, 0.9);
  constexpr double kSigmaPx = 0.3;
  constexpr int kRuns = 300;
  Random random(5);
  double sum = 0.0;
  for (int run = 0; run < kRuns; ++run) {
    Make(6, X);
    for (PointView& v : seen_) {
      v.ideal.x() += random.Normal(kSigmaPx);
      v.ideal.y() += random.Normal(kSigmaPx);
    }
    const auto point = TriangulatePoint(seen_, {});
    ASSERT_TRUE(point.has_value());
    ASSERT_EQ(point->num_inliers, 6u);
    const Eigen::Matrix3d covariance = kSigmaPx * kSigmaPx * point->covariance_1px;
    sum += (point->xyz - X).dot(covariance.inverse() * (point->xyz - X));
  }
  // Standard deviation of the mean: sqrt(6 / 300) = 0.14.
  EXPECT_NEAR(sum / kRuns, 3.0, 0.45);
}

TEST_F(PointTriangulationTest, RefinementEndsWhereTheGradientIsZero) {
  Make(5, {0.2, 0.1, 0.0});
  for (size_t i = 0; i < seen_.size(); ++i) seen_[i].ideal.x() += i % 2 == 0 ? 0.8 : -0.5;
  const auto X = RefinePoint(seen_, Eigen::Vector3d(0.25, 0.05, 0.3));
  ASSERT_TRUE(X.has_value());
  const auto cost = [&](const Eigen::Vector3d& at) {
    double sum = 0.0;
    for (const PointView& v : seen_) sum += (*v.view->Project(at) - v.ideal).squaredNorm();
    return sum;
  };
  for (int axis = 0; axis < 3; ++axis) {
    const Eigen::Vector3d step = 1e-5 * Eigen::Vector3d::Unit(axis);
    EXPECT_NEAR((cost(*X + step) - cost(*X - step)) / 2e-5, 0.0, 1e-4);
  }
}

TEST_F(PointTriangulationTest, TheJacobianIsThatOfTheProjection) {
  Make(1, {0.2, 0.1, 0.0});
  const Eigen::Vector3d X(0.7, -0.4, 1.3);
  const Matrix23d J = ProjectionJacobian(views_[0], X);
  for (int axis = 0; axis < 3; ++axis) {
    const Eigen::Vector3d step = 1e-6 * Eigen::Vector3d::Unit(axis);
    const Eigen::Vector2d numeric =
        (*views_[0].Project(X + step) - *views_[0].Project(X - step)) / 2e-6;
    EXPECT_LT((J.col(axis) - numeric).norm(), 1e-6);
  }
}

TEST_F(PointTriangulationTest, UnsolvableViewsGiveNothingAndTheReason) {
  PointTriangulationFailure failure;
  Make(2, {0.2, 0.1, 0.0});
  EXPECT_FALSE(TriangulatePoint({seen_.data(), 1}, {}, &failure).has_value());
  EXPECT_EQ(failure, PointTriangulationFailure::kFewViews);
  EXPECT_FALSE(TriangulatePoint(seen_, {.min_angle_deg = 40.0}, &failure).has_value());
  EXPECT_EQ(failure, PointTriangulationFailure::kSmallAngle);
  // Two observations by one camera: no angle at all.
  const PointView same[] = {seen_[0], seen_[0]};
  EXPECT_FALSE(TriangulatePoint(same, {}, &failure).has_value());
  // Rays that meet behind the cameras.
  const PointView behind[] = {{&views_[0], {795, 300}}, {&views_[1], {5, 300}}};
  EXPECT_FALSE(TriangulatePoint(behind, {}, &failure).has_value());
  EXPECT_EQ(failure, PointTriangulationFailure::kFewViews);
}

TEST_F(PointTriangulationTest, NewPointsAreConsistentWithTheirImagesInPixelsOfThePhotograph) {
  Make(4, {0.2, 0.1, 0.0}, "OPENCV");
  const point3D_t id = AddPointWithObservations({1.0, -0.8, 0.5}, &model_);
  EXPECT_EQ(id, 1u);
  EXPECT_EQ(model_.points3D.at(id).track.size(), 4u);
  EXPECT_LT(model_.points3D.at(id).error, 1e-9);
  EXPECT_EQ(model_.points3D.NextId(), 2u);
  // One of four observations 2 px off: 0.5 px in the mean.
  model_.images.at(2).points2D[0].xy.x() += 2.0;
  EXPECT_NEAR(*MeanReprojectionErrorPx(model_, model_.points3D.at(id)), 0.5, 1e-9);
  EXPECT_EQ(model_.FindInconsistency(), std::nullopt);
}

}  // namespace
}  // namespace holba
