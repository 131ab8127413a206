// SPDX-License-Identifier: BSD-3-Clause
#include "holba/pipeline/match_points.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <fstream>

#include "holba/base/error.h"
#include "holba/base/random.h"
#include "holba/frontend/onnx/onnx_testing.h"
#include "holba/geometry/angle.h"
#include "holba/pipeline/pair_lists.h"

namespace holba {
namespace {

using testing::ElementsAre;
using testing::Pair;

// Images of points that a camera on a line sees, each with a descriptor of its own, and other
// features without a counterpart.
class MatchPointsTest : public testing::Test {
 protected:
  static constexpr int kNumPoints = 150, kNumOthers = 60;

  void SetUp() override {
    std::string name = (std::filesystem::path(testing::TempDir()) / "holba_match_XXXXXX").string();
    folder_ = mkdtemp(name.data());
    path_ = folder_ / "database.db";
    Random random(4);
    for (int i = 0; i < kNumPoints; ++i) {
      points_.emplace_back(random.Uniform(-3, 3), random.Uniform(-2, 2), random.Uniform(4, 9));
      descriptors_.push_back(RandomDescriptor(&random));
    }
    Database database(path_);
    camera_.model = FindCameraModel("PINHOLE");
    camera_.width = 800;
    camera_.height = 600;
    camera_.params = {500, 500, 400, 300};
    database.AddCamera(1, {camera_, true});
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  static std::vector<uint8_t> RandomDescriptor(Random* random) {
    std::vector<double> x(128);
    double squared = 0.0;
    for (double& v : x) {
      v = std::abs(random->Normal());
      squared += v * v;
    }
    std::vector<uint8_t> descriptor;
    for (double v : x) descriptor.push_back(uint8_t(std::min(255.0, 512 * v / std::sqrt(squared))));
    return descriptor;
  }

  // An image of the camera at x = `place`, turned about its axis.
  image_t AddImage(double place, Database* database) {
    const image_t id = static_cast<image_t>(database->ReadImages().size() + 1);
    Random random(id);
    database->AddImage(id, {"image" + std::to_string(id) + ".jpg", 1});
    Keypoints keypoints;
    Descriptors descriptors;
    const Rigid3d cam_from_world{ExpRotation({0, 0, 0.05 * id}), {-place, 0.1 * id, 0.0}};
    for (int i = 0; i < kNumPoints; ++i) {
      Eigen::Vector2d pixel;
      const Eigen::Vector3d X = cam_from_world * points_[i];
      EXPECT_TRUE(camera_.model->project(camera_.params.data(), X, &pixel));
      Add(pixel + Eigen::Vector2d(random.Normal(0.3), random.Normal(0.3)), descriptors_[i],
          &keypoints, &descriptors);
    }
    for (int i = 0; i < kNumOthers; ++i) {
      Add({random.Uniform(0, 800), random.Uniform(0, 600)}, RandomDescriptor(&random), &keypoints,
          &descriptors);
    }
    database->WriteKeypoints(id, keypoints);
    database->WriteDescriptors(id, descriptors);
    return id;
  }

  static void Add(const Eigen::Vector2d& pixel, const std::vector<uint8_t>& descriptor,
                  Keypoints* keypoints, Descriptors* descriptors) {
    keypoints->data.insert(keypoints->data.end(), {float(pixel.x()), float(pixel.y())});
    descriptors->data.insert(descriptors->data.end(), descriptor.begin(), descriptor.end());
  }

  void AddImages(int count) {
    Database database(path_);
    for (int i = 0; i < count; ++i) AddImage(0.4 * i, &database);
  }

  std::filesystem::path folder_, path_;
  Camera camera_;
  std::vector<Eigen::Vector3d> points_;
  std::vector<std::vector<uint8_t>> descriptors_;
};

void IgnoreProgress(size_t) {}

TEST_F(MatchPointsTest, CommonPointsAreMatchedAndVerified) {
  AddImages(3);
  Database database(path_);
  const auto pairs = ListPairs({}, database, 1);
  ASSERT_THAT(pairs, ElementsAre(Pair(1, 2), Pair(1, 3), Pair(2, 3)));
  const MatchPointsReport report = MatchPoints({}, pairs, &database, IgnoreProgress);
  EXPECT_EQ(report.num_verified, 3u);
  for (const auto& [id1, id2] : pairs) {
    const auto matches = database.ReadMatches(id1, id2);
    ASSERT_TRUE(matches);
    for (const auto& match : *matches) EXPECT_EQ(match[0], match[1]);
    EXPECT_EQ(matches->size(), size_t{kNumPoints});
    const auto geometry = database.ReadTwoViewGeometry(id1, id2);
    ASSERT_TRUE(geometry);
    EXPECT_EQ(geometry->config, TwoViewConfig::kCalibrated);
    EXPECT_GE(geometry->inlier_matches.size(), size_t{kNumPoints} - 2);
    ASSERT_TRUE(geometry->cam2_from_cam1);
    EXPECT_LT(RadToDeg(LogRotation(geometry->cam2_from_cam1->rotation).norm()),
              RadToDeg(0.05 * (id2 - id1)) + 0.3);
  }
}

TEST_F(MatchPointsTest, WhatIsThereSeveralTimesIsKeptForTheInliersItWasMeasuredFor) {
  AddImages(2);
  Database database(path_);
  MatchPoints({}, {{1, 2}}, &database, IgnoreProgress);
  const TwoViewGeometry geometry = *database.ReadTwoViewGeometry(1, 2);
  const std::string settings = RepetitionSettings({}, geometry);
  EXPECT_EQ(database.ReadPairRepetitionSettings(1, 2), settings);
  const PairRepetition found = *database.ReadPairRepetition(1, 2, settings);
  EXPECT_EQ(found.ratios.size(), geometry.inlier_matches.size());
  EXPECT_GE(found.num_near[0], uint32_t{kNumPoints});
  // All inliers passed the ratio test, from both sides.
  for (const float ratio : found.ratios) EXPECT_LT(ratio, DescriptorMatchOptions().max_ratio);
  // For other inliers it does not count.
  TwoViewGeometry other = geometry;
  other.inlier_matches.pop_back();
  EXPECT_FALSE(database.ReadPairRepetition(1, 2, RepetitionSettings({}, other)).has_value());

  AddImages(1);
  MatchPointsOptions options;
  options.keep_repetition = false;
  MatchPoints(options, {{1, 3}}, &database, IgnoreProgress);
  EXPECT_TRUE(database.ReadTwoViewGeometry(1, 3).has_value());
  EXPECT_FALSE(database.ReadPairRepetitionSettings(1, 3).has_value());
}

TEST_F(MatchPointsTest, AModelOfTheUserMatchesInPlaceOfTheNearestDescriptors) {
  HOLBA_SKIP_WITHOUT_ONNX_RUNTIME();
  AddImages(2);
  // Matches the points 10 to 49 with themselves, and the first with the second.
  std::vector<int64_t> rows = {0, 1};
  for (int64_t i = 10; i < 50; ++i) rows.insert(rows.end(), {i, i});
  TinyModel model;
  for (const char* name : {"k1", "k2"}) model.Input(name, TinyModel::kFloat, {1, -1, 2});
  for (const char* name : {"d1", "d2"}) model.Input(name, TinyModel::kFloat, {1, -1, 128});
  model.Output("m", TinyModel::kInt64, {41, 2})
      .Constant<int64_t>("rows", {41, 2}, rows)
      .Node("Identity", {"rows"}, {"m"})
      .Write(folder_ / "m.onnx");
  std::ofstream(folder_ / "m.json") << R"({"kind": "matcher", "model": "m.onnx",
      "inputs": {"keypoints1": "k1", "keypoints2": "k2", "descriptors1": "d1",
      "descriptors2": "d2"}, "outputs": {"matches": "m"}})";
  Database database(path_);
  MatchPointsOptions options;
  options.onnx_matcher_path = (folder_ / "m.json").string();
  MatchPoints(options, {{1, 2}}, &database, IgnoreProgress);
  EXPECT_EQ(database.ReadMatches(1, 2)->size(), 41u);
  const TwoViewGeometry geometry = *database.ReadTwoViewGeometry(1, 2);
  EXPECT_GE(geometry.inlier_matches.size(), 38u);
  for (const auto& match : geometry.inlier_matches) EXPECT_EQ(match[0], match[1]);
}

TEST_F(MatchPointsTest, AStoppedRunGoesOnToTheSameResult) {
  AddImages(6);
  const std::filesystem::path other = folder_ / "other.db";
  std::filesystem::copy_file(path_, other);
  Database whole(path_), resumed(other);
  const auto pairs = ListPairs({}, whole, 1);
  MatchPointsOptions options;
  options.num_threads = 1;
  MatchPoints(options, pairs, &whole, IgnoreProgress);

  options.num_threads = 2;
  MatchPoints(options, {pairs.begin() + 4, pairs.begin() + 9}, &resumed, IgnoreProgress);
  // Matched, but not verified: as another program may have left it.
  resumed.WriteMatches(pairs[0].first, pairs[0].second,
                       *whole.ReadMatches(pairs[0].first, pairs[0].second));
  const MatchPointsReport report = MatchPoints(options, pairs, &resumed, IgnoreProgress);
  EXPECT_EQ(report.pairs_reused, 5u);
  EXPECT_EQ(report.num_verified, pairs.size());
  for (const auto& [id1, id2] : pairs) {
    EXPECT_EQ(*resumed.ReadMatches(id1, id2), *whole.ReadMatches(id1, id2));
    const auto a = whole.ReadTwoViewGeometry(id1, id2), b = resumed.ReadTwoViewGeometry(id1, id2);
    EXPECT_EQ(a->config, b->config);
    if (ImagePair(id1, id2) == pairs[0]) continue;  // sampled in another order
    EXPECT_EQ(a->inlier_matches, b->inlier_matches);
    EXPECT_EQ(*a->E, *b->E);
    EXPECT_EQ(a->cam2_from_cam1->translation, b->cam2_from_cam1->translation);
  }
  EXPECT_EQ(MatchPoints(options, pairs, &resumed, IgnoreProgress).pairs_reused, pairs.size());
}

TEST_F(MatchPointsTest, ImagesWithoutFeaturesAreNamed) {
  AddImages(2);
  Database database(path_);
  database.AddImage(9, {"empty.jpg", 1});
  const MatchPointsReport report =
      MatchPoints({}, ListPairs({}, database, 1), &database, IgnoreProgress);
  EXPECT_EQ(report.num_verified, 1u);
  EXPECT_THAT(report.without_features, ElementsAre("empty.jpg"));
  EXPECT_THAT(report.dropped, ElementsAre(Pair("too few matches", 2u)));
  EXPECT_EQ(database.ReadTwoViewGeometry(1, 9)->config, TwoViewConfig::kDegenerate);
}

TEST_F(MatchPointsTest, DescriptorsThatDoNotBelongToTheKeypointsAreRefused) {
  AddImages(2);
  Database database(path_);
  Keypoints fewer = *database.ReadKeypoints(2);
  fewer.data.resize(2 * 50);
  database.WriteKeypoints(2, fewer);
  EXPECT_THROW(MatchPoints({}, {{1, 2}}, &database, IgnoreProgress), InputError);
  EXPECT_FALSE(database.ReadMatches(1, 2));
}

TEST_F(MatchPointsTest, GuidedMatchingFindsWhatLooksAlikeElsewhere) {
  // Every descriptor twice, far apart in the picture: ambiguous until the geometry is known.
  for (int i = 100; i < kNumPoints; ++i) descriptors_[i] = descriptors_[i - 100];
  AddImages(2);
  for (bool guided : {false, true}) {
    const std::filesystem::path copy = folder_ / (guided ? "guided.db" : "plain.db");
    std::filesystem::copy_file(path_, copy);
    Database database(copy);
    MatchPointsOptions options;
    options.guided_matching = guided;
    MatchPoints(options, {{1, 2}}, &database, IgnoreProgress);
    const auto geometry = database.ReadTwoViewGeometry(1, 2);
    size_t num_right = 0;
    for (const auto& match : geometry->inlier_matches) num_right += match[0] == match[1];
    EXPECT_EQ(database.ReadMatches(1, 2)->size(), 50u);
    if (guided) {
      EXPECT_GT(num_right, 130u);
    } else {
      EXPECT_LE(num_right, 50u);
    }
    EXPECT_GE(num_right + 5, geometry->inlier_matches.size());
  }
}

TEST_F(MatchPointsTest, VerificationCanBeLeftOut) {
  AddImages(2);
  Database database(path_);
  MatchPointsOptions options;
  options.skip_geometric_verification = true;
  MatchPoints(options, {{1, 2}}, &database, IgnoreProgress);
  EXPECT_TRUE(database.ReadMatches(1, 2));
  EXPECT_FALSE(database.ReadTwoViewGeometry(1, 2));
}

TEST_F(MatchPointsTest, ExhaustivePairsAreAllPairsOnce) {
  AddImages(7);
  Database database(path_);
  PairListOptions options;
  options.block_size = 3;
  auto pairs = ListPairs(options, database, 1);
  EXPECT_EQ(pairs.size(), 21u);
  std::sort(pairs.begin(), pairs.end());
  EXPECT_EQ(std::unique(pairs.begin(), pairs.end()), pairs.end());
  for (const auto& [a, b] : pairs) EXPECT_LT(a, b);
}

TEST_F(MatchPointsTest, SequentialPairsAreNextAndPowersOfTwo) {
  AddImages(7);
  Database database(path_);
  PairListOptions options;
  options.selection = PairSelection::kSequential;
  options.overlap = 2;
  options.quadratic_overlap = false;
  EXPECT_EQ(ListPairs(options, database, 1).size(), 6u + 5u);
  options.quadratic_overlap = true;  // and 4 further on
  EXPECT_EQ(ListPairs(options, database, 1).size(), 6u + 5u + 3u);
}

TEST_F(MatchPointsTest, SpatialPairsAreNear) {
  AddImages(4);
  Database database(path_);
  PairListOptions options;
  options.selection = PairSelection::kSpatial;
  EXPECT_THROW(ListPairs(options, database, 1), InputError);
  // Latitude: about 11 m for 1e-4 degrees.
  for (int id = 1; id <= 4; ++id) {
    database.Execute("UPDATE images SET prior_tx = " + std::to_string(30.0 * id) +
                     ", prior_ty = 0, prior_tz = " + std::to_string(1000 * id) +
                     " WHERE image_id = " + std::to_string(id));
  }
  options.max_distance = 40.0;
  EXPECT_THAT(ListPairs(options, database, 1), ElementsAre(Pair(1, 2), Pair(2, 3), Pair(3, 4)));
  options.ignore_z = false;
  EXPECT_TRUE(ListPairs(options, database, 1).empty());
}

TEST_F(MatchPointsTest, WgsPositionsAreMetres) {
  AddImages(3);
  Database database(path_);
  for (int id = 1; id <= 3; ++id) {
    // A blob of three doubles: latitude 47 + id * 1e-3 degrees (111 m), longitude 8, altitude 0.
    const double values[3] = {47.0 + 1e-3 * id * id, 8.0, 0.0};
    std::string hex;
    for (size_t k = 0; k < sizeof(values); ++k) {
      char text[3];
      std::snprintf(text, sizeof(text), "%02x", reinterpret_cast<const uint8_t*>(values)[k]);
      hex += text;
    }
    database.Execute(
        "INSERT INTO pose_priors(pose_prior_id, corr_data_id, corr_sensor_id, "
        "corr_sensor_type, position, coordinate_system) VALUES(" +
        std::to_string(id) + ", " + std::to_string(id) + ", 1, 0, X'" + hex + "', 0)");
  }
  PairListOptions options;
  options.selection = PairSelection::kSpatial;
  options.max_distance = 400.0;  // 3e-3 degrees are 333 m, 5e-3 are 556 m
  EXPECT_THAT(ListPairs(options, database, 1), ElementsAre(Pair(1, 2)));
}

TEST_F(MatchPointsTest, ListsNamePairs) {
  AddImages(3);
  Database database(path_);
  PairListOptions options;
  options.selection = PairSelection::kList;
  EXPECT_THROW(options.Check(), InputError);
  options.match_list_path = (folder_ / "pairs.txt").string();
  std::ofstream(options.match_list_path) << "# two\nimage3.jpg image1.jpg\r\n\nimage2.jpg "
                                            "image3.jpg\nimage1.jpg image3.jpg\n";
  EXPECT_THAT(ListPairs(options, database, 1), ElementsAre(Pair(1, 3), Pair(2, 3)));
  std::ofstream(options.match_list_path) << "image3.jpg image7.jpg\n";
  EXPECT_THROW(ListPairs(options, database, 1), InputError);
}

TEST_F(MatchPointsTest, ImagesThatLookAlikeAreRetrieved) {
  // Two places, whose images share their points.
  Database database(path_);
  for (int i = 0; i < 4; ++i) AddImage(0.2 * i, &database);
  Random random(77);
  for (auto& descriptor : descriptors_) descriptor = RandomDescriptor(&random);
  for (int i = 0; i < 4; ++i) AddImage(0.2 * i, &database);
  PairListOptions options;
  options.selection = PairSelection::kRetrieval;
  options.num_images = 3;
  const auto pairs = ListPairs(options, database, 2);
  EXPECT_EQ(pairs.size(), 12u);
  for (const auto& [a, b] : pairs) EXPECT_EQ(a <= 4, b <= 4) << a << " " << b;
  EXPECT_EQ(ListPairs(options, database, 1), pairs);
}

}  // namespace
}  // namespace holba
