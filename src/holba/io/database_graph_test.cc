// SPDX-License-Identifier: BSD-3-Clause
#include "holba/io/database_graph.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <set>

#include "holba/base/data_testing.h"
#include "holba/base/error.h"
#include "holba/io/database_testing.h"
#include "holba/io/test_models.h"

namespace holba {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

// `num` matches of keypoint i with keypoint i + shift.
TwoViewGeometry Geometry(TwoViewConfig config, point2D_t num, point2D_t shift = 0) {
  TwoViewGeometry geometry;
  geometry.config = config;
  for (point2D_t i = 0; i < num; ++i) geometry.inlier_matches.push_back({i, i + shift});
  return geometry;
}

Keypoints ZeroKeypoints(size_t num) {
  Keypoints keypoints;
  keypoints.data.assign(2 * num, 0.0f);
  return keypoints;
}

TEST(ReadCorrespondenceGraph, TakesThePairsThatColmapsMapperTakes) {
  const TestFolder folder;
  Database database(folder / "database.db");
  AddImages(4, &database);
  for (image_t id = 1; id <= 4; ++id) database.WriteKeypoints(id, ZeroKeypoints(30));
  database.WriteTwoViewGeometry(1, 2, Geometry(TwoViewConfig::kCalibrated, 15));
  database.WriteTwoViewGeometry(3, 1, Geometry(TwoViewConfig::kUncalibrated, 14));
  database.WriteTwoViewGeometry(2, 3, Geometry(TwoViewConfig::kWatermark, 20, 3));
  database.WriteTwoViewGeometry(2, 4, Geometry(TwoViewConfig::kDegenerate, 0));
  database.WriteMatches(1, 4, PointMatches(20, {1, 1}));  // not verified

  const auto num_matches = [](const CorrespondenceGraph& graph) {
    std::map<ImagePair, size_t> numbers;
    for (const image_t a : graph.image_ids()) {
      for (const MatchedImage& m : graph.MatchedImages(a)) {
        if (a < m.image_id) numbers[{a, m.image_id}] = m.num_matches;
      }
    }
    return numbers;
  };
  const CorrespondenceGraph graph = ReadCorrespondenceGraph(database);
  EXPECT_THAT(graph.image_ids(), ElementsAre(1, 2, 3, 4));
  EXPECT_EQ(num_matches(graph), (std::map<ImagePair, size_t>{{{1, 2}, 15}, {{2, 3}, 20}}));
  EXPECT_EQ(graph.GeometryBetween(2, 3).config, TwoViewConfig::kWatermark);
  EXPECT_EQ(graph.CorrespondencesOf(2, 4)[1], (Correspondence{3, 7}));
  EXPECT_EQ(num_matches(ReadCorrespondenceGraph(database, {.ignore_watermarks = true})),
            (std::map<ImagePair, size_t>{{{1, 2}, 15}}));
  EXPECT_EQ(
      num_matches(ReadCorrespondenceGraph(database, {.min_num_matches = 0})),
      (std::map<ImagePair, size_t>{{{1, 2}, 15}, {{1, 3}, 14}, {{2, 3}, 20}}));
}

TEST(ReadCorrespondenceGraph, TakesSegmentsAndTheirMatches) {
  const TestFolder folder;
  Database database(folder / "database.db");
  AddImages(2, &database);
  const ImageFeatureMap features = {{1, RandomFeatures(1, 6)}, {2, RandomFeatures(2, 4)}};
  const LineMatchMap matches = {{{1, 2}, {{5, 3, 0.5f}, {5, 0, 0.25f}}}};
  const CorrespondenceGraph graph = ReadCorrespondenceGraph(database, {}, &features, &matches);
  EXPECT_EQ(graph.NumKeypoints(1), 0u);
  EXPECT_EQ(graph.NumSegments(1), 6u);
  EXPECT_EQ(graph.NumSegments(2), 4u);
  EXPECT_EQ(graph.NumLineMatches(2, 1), 2u);
  EXPECT_EQ(graph.LineCorrespondencesOf(2, 3)[0].line2D_idx, 5u);
}

TEST(ReadCorrespondenceGraph, SaysWhichImageIsNotThere) {
  const TestFolder folder;
  Database database(folder / "database.db");
  AddImages(2, &database);
  database.WriteKeypoints(1, ZeroKeypoints(30));
  database.WriteTwoViewGeometry(1, 2, Geometry(TwoViewConfig::kCalibrated, 20));
  const auto message = [&] {
    try {
      ReadCorrespondenceGraph(database);
    } catch (const InputError& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  EXPECT_THAT(message(), HasSubstr("no keypoints of image 2"));
  database.WriteKeypoints(2, ZeroKeypoints(30));
  EXPECT_EQ(message(), "");
  database.WriteTwoViewGeometry(2, 7, Geometry(TwoViewConfig::kCalibrated, 20));
  EXPECT_THAT(message(), HasSubstr("there is no image 7"));
}

// Databases that users made with COLMAP: the graph holds what reading the rows directly gives.
struct Real {
  const char* name;
  size_t num_images, num_pairs;
};
class RealDatabases : public testing::TestWithParam<Real> {};

TEST_P(RealDatabases, AgreeWithDirectReading) {
  HOLBA_SKIP_WITHOUT_DATA();
  const TestFolder folder;
  const fs::path path = folder / "database.db";
  fs::copy_file(DataFolder() / "models_other" / GetParam().name / "database.db", path);
  fs::permissions(path, fs::perms::owner_write, fs::perm_options::add);
  const Database database(path);
  const CorrespondenceGraph graph = ReadCorrespondenceGraph(database);
  EXPECT_EQ(graph.image_ids().size(), GetParam().num_images);
  std::map<image_t, std::set<point2D_t>> matched_keypoints;
  std::map<image_t, size_t> num_correspondences;
  size_t num_pairs = 0;
  const auto images = database.ReadImages();
  for (const auto& [id1, image1] : images) {
    EXPECT_EQ(graph.NumKeypoints(id1), database.ReadKeypoints(id1)->size());
    for (const auto& [id2, image2] : images) {
      if (id1 == id2) continue;
      const auto geometry = database.ReadTwoViewGeometry(id1, id2);
      if (!geometry || geometry->inlier_matches.size() < 15) {
        EXPECT_EQ(graph.NumMatches(id1, id2), 0u);
        continue;
      }
      num_pairs += id1 < id2;
      PointMatches sorted = geometry->inlier_matches;
      std::sort(sorted.begin(), sorted.end());
      EXPECT_EQ(graph.MatchesBetween(id1, id2), sorted);
      EXPECT_EQ(graph.GeometryBetween(id1, id2).config, geometry->config);
      num_correspondences[id1] += sorted.size();
      for (const auto& [idx1, idx2] : sorted) matched_keypoints[id1].insert(idx1);
    }
  }
  EXPECT_EQ(num_pairs, GetParam().num_pairs);
  for (const auto& [id, image] : images) {
    EXPECT_EQ(graph.NumCorrespondences(id), num_correspondences[id]);
    EXPECT_EQ(graph.NumObservations(id), matched_keypoints[id].size());
  }
}

// The numbers of rows with 15 inliers or more, counted by SQL.
INSTANTIATE_TEST_SUITE_P(ModelsOther, RealDatabases,
                         testing::Values(Real{"nerfprep13_bin", 52, 147},
                                         Real{"brianmax3_txt", 6, 3}),
                         [](const auto& info) { return std::string(info.param.name); });

}  // namespace
}  // namespace holba
