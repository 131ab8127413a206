// SPDX-License-Identifier: BSD-3-Clause
#include "holba/estimation/points/point_uncertainty.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "holba/estimation/points/point_scene_testing.h"
#include "holba/geometry/angle.h"

namespace holba {
namespace {

using testing::DoubleNear;

TEST(PointUncertainty, CovarianceIsTheScatterOfRepeatedTriangulations) {
  Random random(3);
  Reconstruction model = MakeCameraRow(5, 0.7);
  const Eigen::Vector3d X(1.0, -2.0, 10.0);
  constexpr int kTrials = 3000;
  Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
  for (int i = 0; i < kTrials; ++i) {
    const Eigen::Vector3d e = model.points3D.at(AddPoint(X, 0.5, &random, &model)).xyz - X;
    scatter += e * e.transpose() / kTrials;
  }
  const ViewMap views(model);
  const auto covariance = PointCovariance(views, X, model.points3D.at(1).track, 0.5);
  ASSERT_TRUE(covariance);
  // Relative scatter of a variance from n trials: sqrt(2 / n) = 2.6 %.
  const Eigen::Matrix3d whitener = covariance->llt().matrixL().toDenseMatrix().inverse();
  const Eigen::Matrix3d ratio = whitener * scatter * whitener.transpose();
  EXPECT_LT((ratio - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff(), 0.1);
  const auto sigma_px = MeasurePointSigmaPx(model, views);
  ASSERT_TRUE(sigma_px);
  EXPECT_NEAR(*sigma_px, 0.5, 0.02);
}

TEST(PointUncertainty, DepthOfOneImageOrOfParallelRaysIsUnknown) {
  Random random(3);
  Reconstruction model = MakeCameraRow(2, 1.0);
  const Point3D point = model.points3D.at(AddPoint({0, 0, 10}, 0.0, &random, &model));
  const ViewMap views(model);
  EXPECT_TRUE(PointCovariance(views, point.xyz, point.track, 1.0));
  const std::vector<PointObservation> one = {point.track[0]},
                                      twice = {point.track[0], point.track[0]};
  EXPECT_FALSE(PointCovariance(views, point.xyz, one, 1.0));
  EXPECT_FALSE(PointCovariance(views, point.xyz, twice, 1.0));
  EXPECT_FALSE(PointCovariance(views, {0, 0, -10}, point.track, 1.0));
  EXPECT_EQ(NumImages(twice), 1);
}

TEST(PointUncertainty, AngleAndLengthOfAPixelAreThoseOfTheGeometry) {
  Random random(3);
  Reconstruction model = MakeCameraRow(3, 1.0);  // at y = 0, -0.1, 0
  const Point3D point = model.points3D.at(AddPoint({0, 0, 10}, 0.0, &random, &model));
  const ViewMap views(model);
  const auto geometry = GeometryOf(views, point);
  ASSERT_TRUE(geometry);
  EXPECT_EQ(geometry->num_images, 3);
  EXPECT_NEAR(geometry->gsd, 10.0 / 700.0, 1e-12);
  EXPECT_NEAR(geometry->angle_rad, 2.0 * std::atan(0.1), 1e-9);
  // 11.4 degrees: sin 15 / sin 11.4 times the GSD.
  const double rad = DegToRad(1.0);
  EXPECT_NEAR(geometry->LengthPerPx(),
              geometry->gsd * std::sin(15 * rad) / std::sin(geometry->angle_rad), 1e-12);
  EXPECT_EQ((PointGeometry{1.0, 1 * rad, 2}.LengthPerPx()), 2.5);
  EXPECT_EQ((PointGeometry{1.0, 40 * rad, 2}.LengthPerPx()), 1.0);
  EXPECT_EQ((PointGeometry{1.0, 179 * rad, 2}.LengthPerPx()), 1.0);
  EXPECT_FALSE(GeometryOf(views, Point3D{.xyz = {0, 0, -1}, .track = point.track}));
}

}  // namespace
}  // namespace holba
