// SPDX-License-Identifier: BSD-3-Clause
#include "holba/scene/ideal_view.h"

#include <gtest/gtest.h>

#include "holba/base/random.h"

namespace holba {
namespace {

Eigen::Vector3d Vector(Random& random) {
  const double x = random.Normal(), y = random.Normal(), z = random.Normal();
  return {x, y, z};
}

// Two images of one distorted camera, looking at the origin from 5 units away.
Reconstruction TwoViews(std::string_view model_name, std::vector<double> params) {
  Reconstruction model;
  model.cameras.Add(1, {FindCameraModel(model_name), 800, 600, std::move(params)});
  Random random(4);
  for (image_t id = 1; id <= 2; ++id) {
    Image image;
    image.name = std::to_string(id);
    image.camera_id = 1;
    image.cam_from_world = {ExpRotation(0.2 * Vector(random)), Eigen::Vector3d(0.3 * id, 0.1, 5)};
    model.images.Add(id, std::move(image));
  }
  model.AddTrivialRigsAndFrames();
  return model;
}

const std::vector<std::pair<std::string_view, std::vector<double>>> kCameras = {
    {"PINHOLE", {600, 620, 400, 290}},
    {"SIMPLE_RADIAL", {600, 400, 300, -0.15}},
    {"OPENCV", {600, 610, 390, 310, -0.1, 0.02, 1e-3, -2e-3}},
    {"OPENCV_FISHEYE", {400, 410, 390, 310, 0.05, -0.01, 1e-3, -2e-3}}};

TEST(IdealView, PixelsAndIdealPixelsAreTheSamePoints) {
  for (const auto& [name, params] : kCameras) {
    const Reconstruction model = TwoViews(name, params);
    const IdealView view(model, 1);
    Random random(1);
    for (int i = 0; i < 100; ++i) {
      const Eigen::Vector3d X = Vector(random);
      Eigen::Vector2d pixel;
      ASSERT_TRUE(view.camera().model->project(view.camera().params.data(),
                                               model.images.at(1).cam_from_world * X, &pixel));
      const auto ideal = view.ToIdeal(pixel);
      ASSERT_TRUE(ideal.has_value());
      EXPECT_LT((*ideal - *view.Project(X)).norm(), 1e-6) << name;
      EXPECT_LT((*view.ToPixel(*ideal) - pixel).norm(), 1e-6) << name;
      // The ray through it meets the point.
      EXPECT_LT(view.Ray(*ideal).cross((X - view.centre()).normalized()).norm(), 1e-8);
      EXPECT_NEAR(view.Depth(X), (model.images.at(1).cam_from_world * X).z(), 1e-12);
    }
  }
}

TEST(IdealView, APointOfALineIsOnTheImageOfTheLine) {
  for (const auto& [name, params] : kCameras) {
    const Reconstruction model = TwoViews(name, params);
    const IdealView view(model, 2);
    Random random(2);
    for (int i = 0; i < 100; ++i) {
      const Eigen::Vector3d a = Vector(random), b = Vector(random);
      const auto l = view.Project(PlueckerLine::FromPoints(a, b));
      ASSERT_TRUE(l.has_value());
      EXPECT_NEAR(l->head<2>().norm(), 1.0, 1e-12);
      const LineSegment2d segment{*view.Project(a), *view.Project(b)};
      EXPECT_NEAR(l->dot(segment.start.homogeneous()), 0.0, 1e-7);
      EXPECT_NEAR(l->dot(segment.end.homogeneous()), 0.0, 1e-7);
      const Eigen::Vector3d normal = view.NormalOfSegment(segment);
      EXPECT_NEAR(normal.dot(a - view.centre()), 0.0, 1e-8);
      EXPECT_NEAR(normal.dot(b - view.centre()), 0.0, 1e-8);
    }
    const Eigen::Vector3d through = view.centre() + Eigen::Vector3d(1, 2, 3);
    EXPECT_FALSE(view.Project(PlueckerLine::FromPoints(view.centre(), through)).has_value());
  }
}

TEST(IdealView, CorrespondingPointsMeetTheFundamentalMatrix) {
  for (const auto& [name, params] : kCameras) {
    const Reconstruction model = TwoViews(name, params);
    const IdealView view1(model, 1), view2(model, 2);
    const Eigen::Matrix3d F = FundamentalMatrix(view1, view2);
    Random random(3);
    for (int i = 0; i < 100; ++i) {
      const Eigen::Vector3d X = Vector(random);
      const Eigen::Vector3d l = F * view1.Project(X)->homogeneous();
      EXPECT_NEAR(l.dot(view2.Project(X)->homogeneous()) / l.head<2>().norm(), 0.0, 1e-8);
    }
  }
}

TEST(IdealView, NothingBehindACameraHasAnImage) {
  const Reconstruction model = TwoViews("PINHOLE", {600, 620, 400, 290});
  const IdealView view(model, 1);
  const Eigen::Vector3d behind = view.centre() - view.R().row(2).transpose();
  EXPECT_FALSE(view.Project(behind).has_value());
}

}  // namespace
}  // namespace holba
