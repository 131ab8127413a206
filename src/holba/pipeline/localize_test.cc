// SPDX-License-Identifier: BSD-3-Clause
#include "holba/pipeline/localize.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <map>
#include <set>

#include "holba/base/error.h"
#include "holba/base/random.h"
#include "holba/group/known_types.h"
#include "holba/pipeline/model_sightings.h"

namespace holba {
namespace {

using ::testing::HasSubstr;

constexpr double kFocal = 500.0;

// A model of four images of 80 points, and a database that has besides them: new1 and new2 of the
// model's camera, zoom1 and zoom2 of a camera of which nothing is known, blind without keypoints,
// lonely without matches, poor with five. Matches are those of the points, a tenth of them wrong.
class LocalizeTest : public testing::Test {
 protected:
  static constexpr size_t kNumPoints = 80;

  void SetUp() override {
    std::string name =
        (std::filesystem::path(testing::TempDir()) / "holba_localize_XXXXXX").string();
    folder_ = mkdtemp(name.data());
    database_.emplace(folder_ / "database.db");
    const Camera known = CameraOf(kFocal), unknown = CameraOf(1.2 * 640);
    const camera_t known_id = database_->AddCamera(std::nullopt, {known, true});
    const camera_t unknown_id = database_->AddCamera(std::nullopt, {unknown, false});
    for (size_t i = 0; i < kNumPoints; ++i) {
      const double x = random_.Uniform(-2, 2), y = random_.Uniform(-1.5, 1.5);
      points_.emplace_back(x, y, random_.Uniform(4, 8));
    }
    for (int k = 0; k < 4; ++k) AddImage("model" + std::to_string(k), known_id, kFocal, 0.4 * k);
    AddImage("new1", known_id, kFocal, 0.15);
    AddImage("new2", known_id, kFocal, 0.95);
    AddImage("zoom1", unknown_id, 900.0, 0.3);
    AddImage("zoom2", unknown_id, 900.0, 0.7);
    ids_["blind"] = database_->AddImage(std::nullopt, {"blind", known_id});
    AddImage("lonely", known_id, kFocal, 0.5);
    AddImage("poor", known_id, kFocal, 0.6);
    for (const char* name : {"new1", "new2", "zoom1", "zoom2"}) AddMatches(name, kNumPoints);
    AddMatches("poor", 5);
    MakeModel(known);
    options_.matching.num_threads = 2;
    options_.extract.num_threads = 2;
  }
  void TearDown() override {
    database_.reset();
    std::filesystem::remove_all(folder_);
  }

  static Camera CameraOf(double focal) {
    return {FindCameraModel("SIMPLE_PINHOLE"), 640, 480, {focal, 320, 240}};
  }

  // Its keypoint i is the point i.
  void AddImage(const std::string& name, camera_t camera_id, double focal, double x) {
    const image_t id = database_->AddImage(std::nullopt, {name, camera_id});
    ids_[name] = id;
    Rigid3d& pose = poses_[name];
    pose.rotation = ExpRotation(Eigen::Vector3d(0.02, -0.05 * x, 0.01)).normalized();
    pose.translation = pose.rotation * Eigen::Vector3d(-x, 0.1 * x, 0.05);
    Keypoints keypoints;
    for (const Eigen::Vector3d& X : points_) {
      const Eigen::Vector3d in_cam = pose * X;
      keypoints.data.push_back(static_cast<float>(focal * in_cam.x() / in_cam.z() + 320));
      keypoints.data.push_back(static_cast<float>(focal * in_cam.y() / in_cam.z() + 240));
    }
    database_->WriteKeypoints(id, keypoints);
  }

  void AddMatches(const std::string& name, size_t count) {
    for (int k = 0; k < 4; ++k) {
      const image_t other = ids_.at("model" + std::to_string(k));
      TwoViewGeometry geometry;
      geometry.config = TwoViewConfig::kUncalibrated;
      for (point2D_t i = 0; i < count; ++i) {
        const bool is_wrong = count == kNumPoints && i % 10 == 3;
        geometry.inlier_matches.push_back(
            {i, is_wrong ? static_cast<point2D_t>((i + 17) % kNumPoints) : i});
      }
      database_->WriteMatches(ids_.at(name), other, geometry.inlier_matches);
      database_->WriteTwoViewGeometry(ids_.at(name), other, geometry);
    }
  }

  void MakeModel(const Camera& camera) {
    model_.cameras.Add(7, camera);
    for (int k = 0; k < 4; ++k) {
      const std::string name = "model" + std::to_string(k);
      Image image;
      image.name = name;
      image.camera_id = 7;
      image.cam_from_world = poses_.at(name);
      const auto keypoints = database_->ReadKeypoints(ids_.at(name));
      for (size_t i = 0; i < kNumPoints; ++i)
        image.points2D.push_back({keypoints->Position(i), kNoId});
      model_.images.Add(static_cast<image_t>(100 + k), std::move(image));
    }
    model_.AddTrivialRigsAndFrames();
    for (point2D_t i = 0; i < kNumPoints; ++i) {
      std::vector<PointObservation> track;
      for (image_t k = 0; k < 4; ++k) track.push_back({100 + k, i});
      model_.AddPoint3D(points_[i], track);
    }
  }

  std::map<std::string, LocalizedImage> Run() {
    report_ = Localize(options_, "", folder_, &*database_, &model_, {});
    std::map<std::string, LocalizedImage> images;
    for (const LocalizedImage& image : report_.images) images.emplace(image.name, image);
    return images;
  }

  double CentreErrorOf(const LocalizedImage& image) const {
    return (image.pose->cam_from_world.OriginInA() - poses_.at(image.name).OriginInA()).norm();
  }

  Random random_{3};
  std::filesystem::path folder_;
  std::optional<Database> database_;
  std::vector<Eigen::Vector3d> points_;
  std::map<std::string, image_t> ids_;
  std::map<std::string, Rigid3d> poses_;
  Reconstruction model_;
  LocalizeOptions options_;
  LocalizeReport report_;
};

TEST_F(LocalizeTest, PosesOfNewImagesAreTheTruthAndTheOthersHaveReasons) {
  auto images = Run();
  ASSERT_EQ(images.size(), 7u);
  EXPECT_EQ(report_.num_localized, 4u);
  for (const char* name : {"new1", "new2"}) {
    const LocalizedImage& image = images.at(name);
    ASSERT_TRUE(image.pose) << image.failure;
    EXPECT_LT(CentreErrorOf(image), 1e-4);
    EXPECT_EQ(image.pose->num_inliers.points, 72u);
    EXPECT_EQ(image.num_neighbours, 4u);
    EXPECT_EQ(image.camera.params[0], kFocal);
    EXPECT_GT(image.CentreSigma(), 0.0);
    EXPECT_LT(image.CentreSigma(), 0.01);
  }
  for (const char* name : {"zoom1", "zoom2"}) {
    const LocalizedImage& image = images.at(name);
    ASSERT_TRUE(image.pose) << image.failure;
    EXPECT_FALSE(image.focal_was_known);
    EXPECT_NEAR(image.camera.params[0], 900.0, 0.5);
    EXPECT_LT(CentreErrorOf(image), 5e-3);
  }
  // One camera: the intrinsics of both are those of one of them.
  EXPECT_EQ(images.at("zoom1").camera.params, images.at("zoom2").camera.params);
  EXPECT_THAT(images.at("blind").failure, HasSubstr("no features"));
  EXPECT_THAT(images.at("lonely").failure, HasSubstr("no match"));
  EXPECT_THAT(images.at("poor").failure, HasSubstr("5 points and 0 lines"));
}

TEST_F(LocalizeTest, TheModelGetsTheNewImagesAndStaysAsItWas) {
  const Reconstruction before = model_;
  auto images = Run();
  EXPECT_EQ(model_.FindInconsistency(), std::nullopt);
  ASSERT_EQ(model_.images.size(), 8u);
  EXPECT_EQ(model_.cameras.size(), 2u);  // the unknown camera is new, once
  for (const auto& [id, image] : before.images) {
    EXPECT_EQ(model_.images.at(id).cam_from_world.translation, image.cam_from_world.translation);
  }
  for (const auto& [id, point] : before.points3D) EXPECT_EQ(model_.points3D.at(id).xyz, point.xyz);
  const image_t id = *images.at("new1").image_id;
  EXPECT_EQ(model_.images.at(id).name, "new1");
  EXPECT_EQ(model_.images.at(id).camera_id, 7u);
  size_t num_observed = 0;
  for (const Point2D& point : model_.images.at(id).points2D)
    num_observed += point.point3D_id != kNoId;
  EXPECT_EQ(num_observed, 72u);
}

TEST_F(LocalizeTest, AnImageThatWaitsInTheModelIsTheOneThatGetsAPose) {
  Image waiting;
  waiting.name = "new1";
  waiting.camera_id = 7;
  model_.AddUnregisteredImage(500, waiting);
  auto images = Run();
  ASSERT_TRUE(images.at("new1").pose);
  EXPECT_EQ(model_.images.size(), 8u);
  EXPECT_TRUE(model_.unregistered_images.empty());
  EXPECT_TRUE(model_.unregistered_frames.empty());
  EXPECT_EQ(model_.FindInconsistency(), std::nullopt);
}

TEST_F(LocalizeTest, ThreadsChangeNothing) {
  const Reconstruction before = model_;
  options_.matching.num_threads = 1;
  const auto one = Run();
  model_ = before;
  options_.matching.num_threads = 3;
  const auto three = Run();
  for (const auto& [name, image] : one) {
    ASSERT_EQ(image.pose.has_value(), three.at(name).pose.has_value());
    if (!image.pose) continue;
    EXPECT_EQ(image.pose->cam_from_world.translation,
              three.at(name).pose->cam_from_world.translation);
    EXPECT_EQ(image.pose->covariance, three.at(name).pose->covariance);
  }
}

TEST_F(LocalizeTest, AnotherDatabaseIsRefused) {
  for (int k = 0; k < 4; ++k) {
    const image_t id = ids_.at("model" + std::to_string(k));
    Keypoints keypoints = *database_->ReadKeypoints(id);
    for (float& x : keypoints.data) x += 5.3f;
    database_->WriteKeypoints(id, keypoints);
  }
  EXPECT_THROW(Run(), InputError);
  model_.images.at(100).name = "x";
  model_.images.at(101).name = "y";
  model_.images.at(102).name = "z";
  model_.images.at(103).name = "w";
  EXPECT_THROW(Run(), InputError);
}

TEST_F(LocalizeTest, NoNewImageIsAFault) {
  for (auto& [name, id] : ids_) {
    if (!name.starts_with("model"))
      database_->Execute("DELETE FROM images WHERE name = '" + name + "'");
  }
  EXPECT_THROW(Run(), InputError);
}

TEST_F(LocalizeTest, KeypointsInAnotherOrderAreFoundByTheirPlaces) {
  const image_t id = ids_.at("model0");
  const Keypoints keypoints = *database_->ReadKeypoints(id);
  Keypoints reversed;
  for (size_t i = keypoints.size(); i-- > 0;) {
    reversed.data.push_back(keypoints.data[2 * i] + 0.3f);
    reversed.data.push_back(keypoints.data[2 * i + 1]);
  }
  database_->WriteKeypoints(id, reversed);
  const FeaturesOfModel features(model_, *database_, {{100, id}});
  EXPECT_EQ(features.num_points_without_keypoint(), 0u);
  EXPECT_EQ(features.num_points_with_keypoint(), kNumPoints);
  const ModelSightings sightings =
      features.Find(*database_, ids_.at("new1"), MatchesTaken::kVerified, {});
  ASSERT_EQ(sightings.points.size(), kNumPoints);
  EXPECT_EQ(sightings.num_images, 1u);
  // Keypoint 0 matches keypoint 0, which is now the last point.
  const Eigen::Vector3d& last = points_.back();
  EXPECT_EQ(model_.points3D.at(sightings.points[0].second).xyz, last);
}

TEST_F(LocalizeTest, LinesAreSeenByMatchedSegmentsAndDirectionsInPairs) {
  const image_t own = ids_.at("new1"), other = ids_.at("model1");
  const LineSegment2d segment{{10, 10}, {90, 40}}, moved{{10.5, 10}, {90, 41}};
  database_->WriteSegments(own, "any", {{{1, 1}, {2, 2}}, {{5, 5}, {50, 60}}});
  database_->WriteSegments(other, "any", {{{300, 1}, {400, 2}}, moved});
  const line2D_t idx = model_.AddLine2D(101, segment);
  const line2D_t idx2 = model_.AddLine2D(102, segment);
  const std::vector<LineObservation> track = {{101, idx}, {102, idx2}};
  const line3D_t id =
      model_.AddLine3D(PlueckerLine::FromPoints({0, 0, 5}, {1, 0, 5}), {0, 0, 5}, {1, 0, 5}, track);
  model_.AddGroup3D(VanishingPointType(), {1, 0, 0}, {}, {id});
  const FeaturesOfModel features(model_, *database_, {{101, other}});
  LineMatchMap matches;
  // Pairs have the smaller id first.
  if (own < other) {
    matches[{own, other}] = {{0, 0, 0.1f}, {1, 1, 0.1f}};
  } else {
    matches[{other, own}] = {{0, 0, 0.1f}, {1, 1, 0.1f}};
  }
  const ModelSightings sightings = features.Find(*database_, own, MatchesTaken::kVerified, matches);
  ASSERT_EQ(sightings.lines.size(), 1u);
  EXPECT_EQ(sightings.lines[0].first, 1u);
  EXPECT_EQ(sightings.lines[0].second, id);
  EXPECT_EQ(sightings.matches.lines[0].segment.end.x(), 50);
  const auto pairs = features.PairDirections({{{0, 0, 1}, 10}, {{1, 0, 0}, 20}});
  ASSERT_EQ(pairs.size(), 2u);
  EXPECT_EQ(pairs[0].direction_in_cam.x(), 1.0);  // more segments first
}

}  // namespace
}  // namespace holba
