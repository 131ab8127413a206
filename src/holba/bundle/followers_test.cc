// SPDX-License-Identifier: BSD-3-Clause
// Points and lines that a single image sees, and intrinsics with few observations.
#include "holba/bundle/followers.h"

#include <gtest/gtest.h>

#include "holba/base/random.h"
#include "holba/bundle/bundle_testing.h"
#include "holba/bundle/reprojection.h"

namespace holba {
namespace {

// Five cameras around twenty points and four lines, with noise on what is observed and on the
// poses.
class FollowersTest : public testing::Test {
 protected:
  FollowersTest() : maker_("SIMPLE_RADIAL", {700, 500, 480, 0.05}) {
    for (int i = 0; i < 5; ++i) {
      maker_.AddImage({7.0 * std::cos(0.7 * i), 6.0 * std::sin(0.7 * i), 3.0 + 0.3 * i},
                      {0, 0, 0.1 * i});
    }
    maker_.Finish();
    for (int k = 0; k < 20; ++k) maker_.AddPoint(Draw(), {1, 2, 3, 4, 5});
    for (int k = 0; k < 4; ++k) maker_.AddLine(Draw(), Draw(), {1, 2, 3, 4, 5});
    options_ = PlainOptions();
    options_.config = BundleConfig::kPointLine;
  }
  Eigen::Vector3d Draw() {
    return {random_.Uniform(-2, 2), random_.Uniform(-2, 2), random_.Uniform(-1, 2)};
  }
  // Moves what is observed by so much, and the poses but for the first.
  void Disturb() {
    for (auto& [id, image] : maker_.model.images) {
      for (Point2D& point : image.points2D)
        point.xy += Eigen::Vector2d(random_.Normal(), random_.Normal());
      if (id == 1) continue;
      Rigid3d pose = image.cam_from_world;
      pose.translation += 0.05 * Draw();
      maker_.model.SetFramePose(image.frame_id, pose);
    }
  }
  // What only image 3 sees, at a wrong depth.
  void AddSeenOnce() {
    for (int k = 0; k < 30; ++k) points_.push_back(maker_.AddPoint(Draw(), {3}));
    for (int k = 0; k < 5; ++k) lines_.push_back(maker_.AddLine(Draw(), Draw(), {3}));
  }
  Eigen::Vector2d PixelResidual(const Reconstruction& model, point3D_t id) const {
    const Point3D& point = model.points3D.at(id);
    const PointObservation& o = point.track.front();
    const Image& image = model.images.at(o.image_id);
    return *PixelOf(model, image, point.xyz) - image.points2D[o.point2D_idx].xy;
  }

  ModelMaker maker_;
  Random random_{7};
  BundleOptions options_;
  std::vector<point3D_t> points_;
  std::vector<line3D_t> lines_;
};

TEST_F(FollowersTest, DoNotPullCamerasAndKeepTheirResiduals) {
  Disturb();
  Reconstruction without = maker_.model;
  AddSeenOnce();
  for (const point3D_t id : points_) maker_.model.points3D.at(id).xyz += 0.3 * Draw();
  Reconstruction with = maker_.model;
  options_.refine_focal_length = true;
  AdjustBundle(options_, TightSolver(), &without);
  const BundleSummary summary = AdjustBundle(options_, TightSolver(), &with);
  EXPECT_EQ(summary.points_seen_once, points_.size());
  EXPECT_EQ(summary.lines_seen_once, lines_.size());
  for (const auto& [id, image] : without.images) {
    const Rigid3d& other = with.images.at(id).cam_from_world;
    EXPECT_EQ(image.cam_from_world.rotation.coeffs(), other.rotation.coeffs());
    EXPECT_EQ(image.cam_from_world.translation, other.translation);
  }
  EXPECT_EQ(without.cameras.at(1).params, with.cameras.at(1).params);
  EXPECT_GT((with.images.at(3).cam_from_world.translation -
             maker_.model.images.at(3).cam_from_world.translation)
                .norm(),
            0.01);
  for (const point3D_t id : points_) {
    EXPECT_LT((PixelResidual(with, id) - PixelResidual(maker_.model, id)).norm(), 1e-6);
    EXPECT_NE(with.points3D.at(id).xyz, maker_.model.points3D.at(id).xyz);
  }
  for (const line3D_t id : lines_) {
    const auto residual = [&](const Reconstruction& model) {
      const Line3D& line = model.lines3D.at(id);
      return EndOffsets(model, model.images.at(3), line.line, line.track.front())->norm();
    };
    EXPECT_LT(std::abs(residual(with) - residual(maker_.model)), 0.05);
  }
}

TEST_F(FollowersTest, AreThoseWhoseOtherObservationsAreBehindTheirCameras) {
  AddSeenOnce();
  Reconstruction& model = maker_.model;
  // Image 5 looks away: what it sees of these points it cannot see.
  std::vector<Eigen::Vector2d> pixels;
  for (const point3D_t id : points_) {
    Image& image = model.images.at(5);
    model.points3D.at(id).track.push_back({5, static_cast<point2D_t>(image.points2D.size())});
    image.points2D.push_back({{100, 100}, id});
    model.points3D.at(id).xyz =
        image.cam_from_world.Inverse() * Eigen::Vector3d(0.1 * random_.Normal(), 0.1, -1.0);
    // And in image 3 it is wherever it is.
  }
  const std::vector<SeenOnce<point3D_t>> once = PointsSeenOnce(model);
  ASSERT_EQ(once.size(), points_.size());
  for (size_t i = 0; i < once.size(); ++i) {
    EXPECT_EQ(once[i].id, points_[i]);
    EXPECT_NE(once[i].image_id, 5u);
  }
}

TEST_F(FollowersTest, AreNoneWherePointsAreHeld) {
  AddSeenOnce();
  options_.fix_points = true;
  const BundleSelection selection = BundleSelection::Everything(maker_.model, options_);
  EXPECT_TRUE(selection.points_seen_once.empty());
  EXPECT_EQ(selection.points.size(), maker_.model.points3D.size());
  EXPECT_EQ(selection.lines_seen_once.size(), lines_.size());
}

TEST_F(FollowersTest, AreCountedByEvaluation) {
  AddSeenOnce();
  const auto terms = TermsByName(EvaluateModel(maker_.model));
  EXPECT_EQ(terms.at("point").residuals, 20u * 5 + points_.size());
  EXPECT_EQ(terms.at("line").residuals, 4u * 5 + lines_.size());
}

TEST_F(FollowersTest, KeepTheirBitsWhereTheCameraStays) {
  Disturb();
  AddSeenOnce();
  Reconstruction model = maker_.model;
  options_.fix_poses = true;
  options_.refine_focal_length = options_.refine_extra_params = false;
  AdjustBundle(options_, TightSolver(), &model);
  for (const point3D_t id : points_)
    EXPECT_EQ(model.points3D.at(id).xyz, maker_.model.points3D.at(id).xyz);
}

TEST_F(FollowersTest, OfOtherIntrinsicsStayWhereTheObservationsAreTooFew) {
  const image_t image_id = maker_.AddImage({0, -8, 2}, {0, 0, 0}, true);
  maker_.model.AddTrivialRigsAndFrames();
  const auto observe = [&](int from, int to) {
    for (int k = from; k < to; ++k) {
      Point3D& point = maker_.model.points3D.at(100 + k);
      auto& points2D = maker_.model.images.at(image_id).points2D;
      point.track.push_back({image_id, static_cast<point2D_t>(points2D.size())});
      points2D.push_back({maker_.Project(image_id, point.xyz), static_cast<point3D_t>(100 + k)});
    }
  };
  const auto held = [&] {
    BundleSelection selection = BundleSelection::Everything(maker_.model, options_);
    return selection.HoldUncertainIntrinsics(maker_.model, options_);
  };
  EXPECT_TRUE(held().empty()) << "what is not observed does not move";
  observe(0, 4);
  ASSERT_EQ(held().size(), 1u);
  EXPECT_EQ(held()[0].camera_id, image_id);
  EXPECT_EQ(held()[0].num_observations, 4u);
  Reconstruction model = maker_.model;
  model.images.at(image_id).points2D[0].xy.x() += 3.0;
  EXPECT_EQ(AdjustBundle(options_, TightSolver(), &model).held_intrinsics.size(), 1u);
  EXPECT_EQ(model.cameras.at(image_id).params, maker_.model.cameras.at(image_id).params);
  // Focal length and one coefficient: 10 equations beyond the 6 of the pose.
  observe(4, 7);
  EXPECT_EQ(held().size(), 1u);
  observe(7, 8);
  EXPECT_TRUE(held().empty());
}

}  // namespace
}  // namespace holba
