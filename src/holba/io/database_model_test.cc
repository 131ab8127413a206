// SPDX-License-Identifier: BSD-3-Clause
// A posed model's images in a Database: ids that are free stay, others are mapped by name.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "holba/base/error.h"
#include "holba/io/database_testing.h"
#include "holba/io/test_models.h"

namespace holba {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Pair;
using ::testing::ThrowsMessage;

// Camera 1 (PINHOLE, images 1 and 3), camera 2 (SIMPLE_RADIAL, image 2), one rig of both.
Reconstruction SmallModel() { return ReadFiles(SmallModelText(), ModelFormat::kText); }

// True if `condition` holds of the database.
bool Holds(const std::string& condition, Database* database) {
  database->Execute("CREATE TEMP TABLE probe(n INTEGER CHECK(n))");
  bool holds = true;
  try {
    database->Execute("INSERT INTO probe SELECT " + condition);
  } catch (const InputError&) {
    holds = false;
  }
  database->Execute("DROP TABLE probe");
  return holds;
}

TEST(MatchImages, FillsAnEmptyDatabaseWithTheModelsIds) {
  const TestFolder folder;
  Database database(folder / "a.db");
  const Reconstruction model = SmallModel();
  EXPECT_THAT(database.MatchImages(model), ElementsAre(Pair(1, 1), Pair(2, 2), Pair(3, 3)));
  const auto images = database.ReadImages();
  EXPECT_EQ(images.at(1).name, "left one.jpg");
  EXPECT_EQ(images.at(2).camera_id, 2u);
  EXPECT_EQ(ToString(database.ReadCameras().at(2).camera), ToString(model.cameras.at(2)));
  EXPECT_THAT(database.ReadKeypoints(1)->data, ElementsAre(10, 20, 30, 40, 50, 60));
  EXPECT_EQ(database.ReadDescriptors(1)->size(), 0u);
  EXPECT_FALSE(database.ReadKeypoints(3).has_value());
  // The rig of both cameras, a frame of two images and one of one.
  EXPECT_TRUE(Holds("(SELECT COUNT(*) FROM rigs) = 1", &database));
  EXPECT_TRUE(
      Holds("(SELECT COUNT(*) FROM rig_sensors WHERE sensor_id = 2 AND "
            "length(sensor_from_rig) = 56) = 1",
            &database));
  EXPECT_TRUE(Holds("(SELECT COUNT(*) FROM frames) = 2", &database));
  EXPECT_TRUE(
      Holds("(SELECT COUNT(*) FROM frame_data GROUP BY frame_id HAVING MIN(data_id) = 1) "
            "= 2",
            &database));
  // Once more: all is there.
  EXPECT_THAT(database.MatchImages(model), ElementsAre(Pair(1, 1), Pair(2, 2), Pair(3, 3)));
  EXPECT_EQ(database.ReadImages().size(), 3u);
  EXPECT_TRUE(Holds("(SELECT COUNT(*) FROM frames) = 2", &database));
}

TEST(MatchImages, GoesByNameAndLeavesWhatIsThere) {
  const TestFolder folder;
  Database database(folder / "a.db");
  const Camera camera{FindCameraModel("SIMPLE_PINHOLE"), 640, 480, {700, 320, 240}};
  database.AddCamera(1, {camera, false});
  database.AddCamera(7, {camera, false});
  database.AddImage(1, {"right.jpg", 7});
  database.AddImage(2, {"other.jpg", 1});
  database.WriteKeypoints(1, {4, {1, 2, 3, 4}});
  const auto ids = database.MatchImages(SmallModel());
  EXPECT_EQ(ids.at(2), 1u);  // right.jpg
  EXPECT_EQ(ids.at(3), 3u);  // c.jpg: its id is free
  EXPECT_EQ(ids.at(1), 4u);  // left one.jpg: its id is taken
  EXPECT_EQ(database.ReadKeypoints(1)->data.size(), 4u);
  EXPECT_EQ(database.ReadKeypoints(4)->size(), 3u);
  const auto images = database.ReadImages();
  EXPECT_EQ(images.size(), 4u);
  // Camera 1 of the model is another than the database's: it got a new id, camera 2 was not needed.
  EXPECT_EQ(images.at(3).camera_id, 8u);
  EXPECT_EQ(images.at(4).camera_id, 8u);
  EXPECT_EQ(ToString(database.ReadCameras().at(8).camera), "PINHOLE 640 480 500 500 320 240");
  EXPECT_EQ(database.ReadCameras().size(), 3u);
  // Every image has its frame.
  EXPECT_TRUE(
      Holds("(SELECT COUNT(*) FROM frame_data JOIN images ON data_id = image_id) = 4", &database));
}

TEST(MatchImages, GivesImagesOfAKnownCameraTheDatabasesCamera) {
  const TestFolder folder;
  Database database(folder / "a.db");
  database.AddCamera(5, {{FindCameraModel("SIMPLE_PINHOLE"), 640, 480, {700, 320, 240}}, false});
  database.AddImage(9, {"c.jpg", 5});
  EXPECT_THAT(database.MatchImages(SmallModel()), ElementsAre(Pair(1, 1), Pair(2, 2), Pair(3, 9)));
  EXPECT_EQ(database.ReadImages().at(1).camera_id, 5u);
  EXPECT_EQ(database.ReadImages().at(2).camera_id, 2u);
}

TEST(MatchImages, RefusesADatabaseOfImagesOfAnotherSize) {
  const TestFolder folder;
  Database database(folder / "a.db");
  database.AddCamera(1, {{FindCameraModel("SIMPLE_PINHOLE"), 1280, 960, {700, 320, 240}}, false});
  database.AddImage(9, {"c.jpg", 1});
  EXPECT_THAT([&] { database.MatchImages(SmallModel()); },
              ThrowsMessage<InputError>(HasSubstr("'c.jpg' has 1280 x 960 pixels here")));
  EXPECT_EQ(database.ReadImages().size(), 1u);
}

}  // namespace
}  // namespace holba
