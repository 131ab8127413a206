// SPDX-License-Identifier: BSD-3-Clause
// A Database and the real COLMAP: each works with what the other wrote.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "holba/base/data_testing.h"
#include "holba/base/error.h"
#include "holba/io/database_testing.h"
#include "holba/io/model_io.h"
#include "holba/io/test_models.h"

namespace holba {
namespace {

namespace fs = std::filesystem;

bool RunShell(const std::string& command) { return std::system(command.c_str()) == 0; }

#define SKIP_WITHOUT_COLMAP()                         \
  HOLBA_SKIP_WITHOUT_DATA();                          \
  if (!RunShell("command -v colmap >/dev/null 2>&1")) \
  GTEST_SKIP() << "the program colmap is not installed: nothing was compared with it"

bool Colmap(const std::string& command, const fs::path& database, const std::string& options) {
  return RunShell("QT_QPA_PLATFORM=offscreen colmap " + command + " --database_path '" +
                  database.string() + "' " + options + " >'" + database.string() + ".log' 2>&1");
}

bool ExtractFeatures(const fs::path& database, const fs::path& images) {
  return Colmap("feature_extractor", database,
                "--image_path '" + images.string() +
                    "' --SiftExtraction.use_gpu 0 --SiftExtraction.max_num_features 300 "
                    "--SiftExtraction.first_octave 0 --SiftExtraction.num_threads 2 "
                    "--ImageReader.single_camera 1 "
                    "--ImageReader.camera_model SIMPLE_RADIAL");
}

bool MatchExhaustively(const fs::path& database) {
  return Colmap("exhaustive_matcher", database, "--SiftMatching.use_gpu 0");
}

// Two photographs of entry_p10.
void CopyPhotographs(const fs::path& to) {
  fs::create_directories(to);
  for (const char* name : {"0000.jpg", "0001.jpg"}) {
    fs::copy_file(DataFolder() / "entry_p10" / "images" / name, to / name);
  }
}

void ExpectFeaturesAndMatches(const Database& database) {
  const auto images = database.ReadImages();
  ASSERT_EQ(images.size(), 2u);
  const auto cameras = database.ReadCameras();
  const auto id1 = *database.FindImage("0000.jpg"), id2 = *database.FindImage("0001.jpg");
  const Camera& camera = cameras.at(images.at(id1).camera_id).camera;
  std::array<Keypoints, 2> keypoints;
  for (int k = 0; k < 2; ++k) {
    const image_t id = k == 0 ? id1 : id2;
    keypoints[k] = *database.ReadKeypoints(id);
    EXPECT_EQ(keypoints[k].num_cols, 6);
    EXPECT_GE(keypoints[k].size(), 300u);
    for (size_t i = 0; i < keypoints[k].size(); ++i) {
      const Eigen::Vector2d p = keypoints[k].Position(i);
      EXPECT_TRUE(p.minCoeff() >= 0 && p.x() <= camera.width && p.y() <= camera.height);
    }
    const auto descriptors = database.ReadDescriptors(id);
    EXPECT_EQ(descriptors->size(), keypoints[k].size());
    EXPECT_EQ(descriptors->num_bytes, 128);
    EXPECT_EQ(descriptors->type, 0);
  }
  // The inliers of both orders of the images satisfy the epipolar constraint in pixels: F, its
  // orientation and the columns of the matches belong together.
  ASSERT_EQ(database.VerifiedPairs(15).size(), 1u);
  for (const bool turn : {false, true}) {
    const image_t a = turn ? id2 : id1, b = turn ? id1 : id2;
    EXPECT_GE(database.ReadMatches(a, b)->size(),
              database.ReadTwoViewGeometry(a, b)->inlier_matches.size());
    const TwoViewGeometry geometry = *database.ReadTwoViewGeometry(a, b);
    ASSERT_GE(geometry.inlier_matches.size(), 100u);
    ASSERT_TRUE(geometry.F.has_value());
    std::vector<double> distances;
    for (const auto& [i, j] : geometry.inlier_matches) {
      const Eigen::Vector2d x1 = keypoints[turn].Position(i), x2 = keypoints[!turn].Position(j);
      const Eigen::Vector3d line = *geometry.F * x1.homogeneous();
      distances.push_back(std::abs(line.dot(x2.homogeneous())) / line.head<2>().norm());
    }
    std::sort(distances.begin(), distances.end());
    EXPECT_LT(distances[distances.size() / 2], 1.0);
  }
}

TEST(DatabaseColmap, ReadsWhatColmapExtractedAndMatched) {
  SKIP_WITHOUT_COLMAP();
  const TestFolder folder;
  CopyPhotographs(folder / "images");
  const fs::path path = folder / "a.db";
  ASSERT_TRUE(ExtractFeatures(path, folder / "images"));
  ASSERT_TRUE(MatchExhaustively(path));
  Database database(path);
  ExpectFeaturesAndMatches(database);
  const auto images = database.ReadImages();
  const auto camera = database.ReadCameras().at(images.begin()->second.camera_id);
  EXPECT_EQ(camera.camera.model->name, "SIMPLE_RADIAL");
  EXPECT_EQ(camera.camera.params.size(), 4u);
  EXPECT_FALSE(camera.has_prior_focal_length);
}

TEST(DatabaseColmap, ColmapWorksWithANewDatabaseOfOurs) {
  SKIP_WITHOUT_COLMAP();
  const TestFolder folder;
  CopyPhotographs(folder / "images");
  const fs::path path = folder / "a.db";
  { const Database database(path); }
  ASSERT_TRUE(Colmap("database_creator", path, ""));
  ASSERT_TRUE(ExtractFeatures(path, folder / "images"));
  ASSERT_TRUE(MatchExhaustively(path));
  ExpectFeaturesAndMatches(Database(path));
}

TEST(DatabaseColmap, ColmapLeavesOurTablesAloneUntilItDeletesTheirImages) {
  SKIP_WITHOUT_COLMAP();
  for (const bool made_by_colmap : {false, true}) {
    SCOPED_TRACE(made_by_colmap);
    const TestFolder folder;
    CopyPhotographs(folder / "images");
    const fs::path path = folder / "a.db";
    if (made_by_colmap) {
      ASSERT_TRUE(Colmap("database_creator", path, ""));
    }
    {
      Database database(path);
      AddImages(2, &database);
      for (image_t id = 1; id <= 2; ++id) WriteAll(id, "s", RandomFeatures(id, 7), &database);
      database.WriteLineMatches(1, 2, "s", {{0, 1, 0.5f}});
    }
    ASSERT_TRUE(ExtractFeatures(path, folder / "images"));
    ASSERT_TRUE(MatchExhaustively(path));
    {
      Database database(path);
      EXPECT_EQ(database.ReadImages().size(), 4u);
      const image_t id = *database.FindImage("0000.jpg");
      WriteAll(id, "s", RandomFeatures(3, 5), &database);
      database.WriteLineMatches(id, 1, "s", {{4, 6, 0.5f}});
    }
    ASSERT_TRUE(Colmap("database_cleaner", path, "--type matches"));
    ASSERT_TRUE(Colmap("database_cleaner", path, "--type features"));
    {
      const Database database(path);
      EXPECT_FALSE(database.ReadKeypoints(*database.FindImage("0000.jpg")).has_value());
      EXPECT_TRUE(database.VerifiedPairs(0).empty());
      EXPECT_EQ(CountParts(database, 1, "s"), 6);
      EXPECT_TRUE(database.ReadLineMatches(1, 2, "s").has_value());
      EXPECT_TRUE(database.ReadLineMatches(1, *database.FindImage("0000.jpg"), "s").has_value());
    }
    ASSERT_TRUE(Colmap("database_cleaner", path, "--type images"));
    {
      Database database(path);
      EXPECT_TRUE(database.ReadImages().empty());
      database.Execute("CREATE TABLE empty(n INTEGER CHECK(n = 0))");
      for (const char* table : {"segments", "segment_descriptors", "corners", "vanishing_points",
                                "label_maps", "normals", "line_matches"}) {
        EXPECT_NO_THROW(
            database.Execute("INSERT INTO empty SELECT COUNT(*) FROM holba_" + std::string(table)))
            << table;
      }
    }
    EXPECT_TRUE(Colmap("database_cleaner", path, "--type all"));
  }
}

// COLMAP must not put descriptors of its own keypoints beside the model's.
TEST(DatabaseColmap, ColmapLeavesThePointsOfAModelAlone) {
  SKIP_WITHOUT_COLMAP();
  const TestFolder folder;
  const fs::path path = folder / "a.db";
  const Reconstruction model = ReadModel(DataFolder() / "entry_p10" / "colmap" / "simple_radial");
  CopyPhotographs(folder / "images");
  { Database(path).MatchImages(model); }
  ASSERT_TRUE(ExtractFeatures(path, folder / "images"));
  ASSERT_TRUE(MatchExhaustively(path));
  const Database database(path);
  EXPECT_EQ(database.ReadImages().size(), model.images.size());
  for (const auto& [image_id, image] : model.images) {
    const Keypoints keypoints = *database.ReadKeypoints(*database.FindImage(image.name));
    ASSERT_EQ(keypoints.size(), image.points2D.size());
    for (size_t i = 0; i < keypoints.size(); ++i) {
      EXPECT_EQ(keypoints.Position(i), image.points2D[i].xy.cast<float>().cast<double>());
    }
  }
}

}  // namespace
}  // namespace holba
