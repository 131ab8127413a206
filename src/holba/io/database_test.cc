// SPDX-License-Identifier: BSD-3-Clause
// COLMAP's tables of a Database, transactions and faults.
#include "holba/io/database.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "holba/base/error.h"
#include "holba/io/database_testing.h"
#include "holba/io/test_models.h"

namespace holba {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Pair;
using ::testing::ThrowsMessage;

// SQL that makes of a new database one of COLMAP 3.8 or before.
constexpr const char* kToOldSchema =
    "DROP TABLE frame_data; DROP TABLE frames; DROP TABLE rig_sensors; DROP TABLE rigs;"
    "DROP TABLE pose_priors; ALTER TABLE descriptors DROP COLUMN type;"
    "ALTER TABLE two_view_geometries DROP COLUMN camera1;"
    "ALTER TABLE two_view_geometries DROP COLUMN camera2;"
    "ALTER TABLE two_view_geometries DROP COLUMN qvec;"
    "ALTER TABLE two_view_geometries DROP COLUMN tvec; PRAGMA user_version = 3600;";

TwoViewGeometry SomeGeometry() {
  TwoViewGeometry geometry;
  geometry.config = TwoViewConfig::kPlanar;
  geometry.F = (Eigen::Matrix3d() << 1, 2, 3, 4, 5, 6, 7, 8, 9.5).finished();
  geometry.E = (Eigen::Matrix3d() << -1, 2, -3, 4, -5, 6, -7, 8, -9).finished();
  geometry.H = (Eigen::Matrix3d() << 2, 0, 1, 0, 4, 0, 0, 0, 1).finished();
  geometry.cam2_from_cam1 =
      Rigid3d(Eigen::Quaterniond(0.5, 0.5, -0.5, 0.5), Eigen::Vector3d(1, 2, 3));
  geometry.inlier_matches = {{0, 2}, {1, 0}};
  return geometry;
}

TEST(Database, GivesBackWhatWasWrittenInNewAndOldSchema) {
  for (const bool old_schema : {false, true}) {
    SCOPED_TRACE(old_schema);
    const TestFolder folder;
    const auto path = folder / "new folder" / "a.db";
    if (old_schema) Database(path).Execute(kToOldSchema);
    const Keypoints keypoints{6, {1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 1, 1, 1, 1, 1, 1}};
    const Descriptors descriptors{old_schema ? 0 : 1, 4, {1, 2, 3, 4, 5, 6, 7, 8, 255, 0, 1, 2}};
    {
      Database database(path);
      AddImages(3, &database);
      for (image_t id = 1; id <= 2; ++id) database.WriteKeypoints(id, keypoints);
      database.WriteDescriptors(2, descriptors);
      database.WriteMatches(2, 1, {{2, 0}, {1, 1}});
      database.WriteMatches(1, 3, {});
      database.WriteTwoViewGeometry(1, 2, SomeGeometry());
    }
    const Database database(path);
    const auto cameras = database.ReadCameras();
    ASSERT_EQ(cameras.size(), 1u);
    EXPECT_EQ(ToString(cameras.at(1).camera), "PINHOLE 640 480 500 501 320 240");
    EXPECT_TRUE(cameras.at(1).has_prior_focal_length);
    EXPECT_EQ(database.ReadImages().size(), 3u);
    EXPECT_EQ(database.ReadImages().at(2).name, "2.jpg");
    EXPECT_EQ(database.FindImage("3.jpg"), 3u);
    EXPECT_EQ(database.FindImage("4.jpg"), std::nullopt);
    const auto read_keypoints = database.ReadKeypoints(2);
    EXPECT_EQ(read_keypoints->data, keypoints.data);
    ASSERT_EQ(read_keypoints->size(), 3u);
    EXPECT_EQ(read_keypoints->Position(1), Eigen::Vector2d(7, 8));
    EXPECT_FALSE(database.ReadKeypoints(3).has_value());
    const auto read_descriptors = database.ReadDescriptors(2);
    EXPECT_EQ(read_descriptors->data, descriptors.data);
    EXPECT_EQ(read_descriptors->size(), 3u);
    EXPECT_EQ(read_descriptors->type, descriptors.type);
    EXPECT_THAT(*database.ReadMatches(1, 2), ElementsAre(std::array{0u, 2u}, std::array{1u, 1u}));
    EXPECT_TRUE(database.ReadMatches(3, 1)->empty());
    EXPECT_FALSE(database.ReadMatches(2, 3).has_value());
    EXPECT_THAT(database.MatchedPairs(0), ElementsAre(Pair(1, 2), Pair(1, 3)));
    EXPECT_THAT(database.MatchedPairs(1), ElementsAre(Pair(1, 2)));
    EXPECT_THAT(database.VerifiedPairs(2), ElementsAre(Pair(1, 2)));
    EXPECT_TRUE(database.VerifiedPairs(3).empty());
    const TwoViewGeometry wanted = SomeGeometry();
    const auto geometry = database.ReadTwoViewGeometry(1, 2);
    EXPECT_EQ(geometry->config, wanted.config);
    EXPECT_EQ(*geometry->F, *wanted.F);
    EXPECT_EQ(*geometry->E, *wanted.E);
    EXPECT_EQ(*geometry->H, *wanted.H);
    EXPECT_EQ(geometry->inlier_matches, wanted.inlier_matches);
    ASSERT_EQ(geometry->cam2_from_cam1.has_value(), !old_schema);
    if (old_schema) continue;
    EXPECT_EQ(geometry->cam2_from_cam1->rotation.coeffs(),
              wanted.cam2_from_cam1->rotation.coeffs());
    EXPECT_EQ(geometry->cam2_from_cam1->translation, wanted.cam2_from_cam1->translation);
  }
}

TEST(Database, TurnsAPairAroundWhenItIsAskedTheOtherWay) {
  const TestFolder folder;
  Database database(folder / "a.db");
  AddImages(2, &database);
  for (image_t id = 1; id <= 2; ++id) database.WriteKeypoints(id, {2, {0, 0, 1, 0, 2, 0}});
  const TwoViewGeometry written = SomeGeometry();
  database.WriteTwoViewGeometry(1, 2, written);
  const auto turned = database.ReadTwoViewGeometry(2, 1);
  EXPECT_EQ(*turned->F, written.F->transpose());
  EXPECT_EQ(*turned->E, written.E->transpose());
  EXPECT_TRUE((*turned->H * *written.H).isIdentity(1e-15));
  const Rigid3d loop = *turned->cam2_from_cam1 * *written.cam2_from_cam1;
  EXPECT_LT(loop.translation.norm(), 1e-14);
  EXPECT_NEAR(std::abs(loop.rotation.w()), 1.0, 1e-14);
  EXPECT_THAT(turned->inlier_matches, ElementsAre(std::array{2u, 0u}, std::array{0u, 1u}));
  database.WriteTwoViewGeometry(2, 1, *turned);
  const auto again = database.ReadTwoViewGeometry(1, 2);
  EXPECT_EQ(*again->F, *written.F);
  EXPECT_TRUE(again->H->isApprox(*written.H, 1e-15));
  EXPECT_EQ(again->inlier_matches, written.inlier_matches);
}

TEST(Database, TakesZerosAndIdentityForUnsetAsOldColmapsWroteThem) {
  const TestFolder folder;
  Database database(folder / "a.db");
  AddImages(2, &database);
  database.WriteTwoViewGeometry(1, 2, SomeGeometry());
  database.Execute(
      "UPDATE two_view_geometries SET rows = 0, data = NULL, F = zeroblob(72), E = zeroblob(72), "
      "H = NULL, qvec = x'000000000000F03F000000000000000000000000000000000000000000000000', "
      "tvec = zeroblob(24)");
  const auto geometry = database.ReadTwoViewGeometry(1, 2);
  EXPECT_FALSE(geometry->F || geometry->E || geometry->H || geometry->cam2_from_cam1);
  EXPECT_TRUE(geometry->inlier_matches.empty());
}

TEST(Database, GivesEachNewImageARigAndAFrame) {
  const TestFolder folder;
  const auto path = folder / "a.db";
  Database database(path);
  AddImages(2, &database);
  // Fails if the rows were not there: they would break the unique indices.
  EXPECT_THROW(database.Execute("INSERT INTO rigs(ref_sensor_id, ref_sensor_type) VALUES(1, 0)"),
               InputError);
  for (const char* image_id : {"1", "2"}) {
    EXPECT_THROW(database.Execute(std::string("INSERT INTO frame_data(frame_id, data_id, "
                                              "sensor_id, sensor_type) VALUES(1, ") +
                                  image_id + ", 1, 0)"),
                 InputError);
  }
}

// COLMAP 4 refuses a database in which some images have frames and others none.
TEST(Database, GivesNoFramesWhereOtherImagesHaveNone) {
  const TestFolder folder;
  Database database(folder / "a.db");
  AddImages(1, &database);
  database.Execute("DELETE FROM frames; DELETE FROM rigs");  // as an older COLMAP left it
  database.AddImage(2, {"2.jpg", 1});
  EXPECT_NO_THROW(
      database.Execute("CREATE TABLE none(n CHECK(n = 0)); "
                       "INSERT INTO none SELECT COUNT(*) FROM frames"));
}

TEST(Database, UndoesATransactionThatIsNotCommitted) {
  const TestFolder folder;
  Database database(folder / "a.db");
  {
    Database::Transaction outer(&database);
    AddImages(1, &database);
    {
      Database::Transaction inner(&database);
      database.AddImage(2, {"2.jpg", 1});
    }
    {
      Database::Transaction inner(&database);
      database.AddImage(3, {"3.jpg", 1});
      inner.Commit();
    }
    outer.Commit();
  }
  {
    Database::Transaction outer(&database);
    {
      Database::Transaction inner(&database);
      database.AddImage(4, {"4.jpg", 1});
      WriteAll(4, "a", RandomFeatures(1, 3), &database);
      inner.Commit();
    }
  }
  EXPECT_THAT(database.ReadImages(), ElementsAre(Pair(1, testing::_), Pair(3, testing::_)));
  EXPECT_EQ(CountParts(database, 4, "a"), 0);
  // Our tables were undone with the rest, and are made again.
  WriteAll(1, "a", RandomFeatures(1, 3), &database);
  EXPECT_EQ(CountParts(database, 1, "a"), 6);
}

TEST(Database, ShowsOthersTheOldContentUntilATransactionIsCommitted) {
  const TestFolder folder;
  Database writer(folder / "a.db");
  const Database reader(folder / "a.db");
  AddImages(1, &writer);
  Database::Transaction transaction(&writer);
  writer.AddImage(2, {"2.jpg", 1});
  EXPECT_EQ(reader.ReadImages().size(), 1u);
  transaction.Commit();
  EXPECT_EQ(reader.ReadImages().size(), 2u);
}

TEST(Database, RefusesWhatIsNoColmapDatabase) {
  const TestFolder folder;
  const auto open = [&](const std::string& name) { return [&, name] { Database(folder / name); }; };
  WriteBytes(folder / "text.db", std::string(5000, 'x'));
  EXPECT_THAT(open("text.db"), ThrowsMessage<InputError>(
                                   AllOf(HasSubstr("text.db"), HasSubstr("no SQLite database"))));
  WriteBytes(folder / "short.db", "SQL");
  EXPECT_THAT(open("short.db"), ThrowsMessage<InputError>(HasSubstr("no SQLite database")));
  std::filesystem::create_directories(folder / "sub.db");
  EXPECT_THAT(open("sub.db"), ThrowsMessage<InputError>(HasSubstr("folder")));
  // Foreign databases are left as they are.
  Database(folder / "other.db").Execute("DROP TABLE keypoints");
  EXPECT_THAT(open("other.db"), ThrowsMessage<InputError>(HasSubstr("no table 'keypoints'")));
  EXPECT_THAT(open("other.db"), ThrowsMessage<InputError>(HasSubstr("no table 'keypoints'")));
  Database(folder / "column.db").Execute("ALTER TABLE cameras RENAME COLUMN params TO p");
  EXPECT_THAT(open("column.db"),
              ThrowsMessage<InputError>(HasSubstr("no column 'params' in table 'cameras'")));
  Database(folder / "ancient.db")
      .Execute("ALTER TABLE two_view_geometries RENAME TO inlier_matches");
  EXPECT_THAT(open("ancient.db"), ThrowsMessage<InputError>(HasSubstr("database_creator")));
  {
    Database later(folder / "later.db");
    AddImages(1, &later);
    later.WriteCorners(1, "", {});
    later.Execute("UPDATE holba_version SET version = 2");
  }
  EXPECT_THAT(open("later.db"), ThrowsMessage<InputError>(HasSubstr("have version 2")));
}

TEST(Database, SaysWhichRowOfColmapsTablesIsDamaged) {
  struct Damage {
    const char* sql;
    const char* message;
  };
  const Damage damages[] = {
      {"UPDATE cameras SET params = x'00'", "table cameras, camera_id = 1"},
      {"UPDATE cameras SET model = 99", "no camera model 99"},
      {"UPDATE cameras SET width = -1", "negative"},
      {"UPDATE cameras SET params = zeroblob(32)", "table cameras, camera_id = 1"},
      {"UPDATE images SET camera_id = -1", "no camera -1"},
      {"UPDATE keypoints SET rows = 4", "table keypoints, image_id = 1: expected 4 rows"},
      {"UPDATE keypoints SET cols = 3", "2, 4 or 6 columns"},
      {"UPDATE keypoints SET rows = -1", "expected -1 rows"},
      {"UPDATE keypoints SET rows = 4611686018427387905", "expected 4611686018427387905 rows"},
      {"UPDATE keypoints SET data = NULL", "found 0 bytes"},
      {"UPDATE keypoints SET rows = 1, data = x'0000C07F00000000'", "not a finite number"},
      {"UPDATE descriptors SET cols = 127", "table descriptors, image_id = 1"},
      {"UPDATE descriptors SET rows = 0, cols = -3", "table descriptors, image_id = 1"},
      {"UPDATE matches SET rows = 3", "table matches, pair_id = 2147483649"},
      {"UPDATE matches SET data = x'00000000030000000000000000000000'",
       "names keypoint 3 of image 2"},
      {"UPDATE two_view_geometries SET data = x'FFFFFFFF000000000000000000000000'",
       "names keypoint 4294967295 of image 1"},
      {"UPDATE two_view_geometries SET config = 10", "config from 0 to 9"},
      {"UPDATE two_view_geometries SET E = x'00'", "expected 9 numbers in E"},
      {"UPDATE two_view_geometries SET qvec = x'000000000000F87F'", "expected 4 numbers in qvec"},
      {"UPDATE two_view_geometries SET tvec = x'000000000000F87F000000000000F87F000000000000F87F'",
       "not finite"},
      {"UPDATE two_view_geometries SET pair_id = 4294967294", "no pair's"},
  };
  for (const Damage& damage : damages) {
    SCOPED_TRACE(damage.sql);
    const TestFolder folder;
    Database database(folder / "a.db");
    AddImages(2, &database);
    for (image_t id = 1; id <= 2; ++id) {
      database.WriteKeypoints(id, {2, {0, 0, 1, 0, 2, 0}});
      database.WriteDescriptors(id, {0, 128, std::vector<uint8_t>(3 * 128)});
    }
    database.WriteMatches(1, 2, {{0, 2}, {1, 0}});
    database.WriteTwoViewGeometry(1, 2, SomeGeometry());
    const auto read_all = [&] {
      database.ReadCameras();
      database.ReadImages();
      database.ReadKeypoints(1);
      database.ReadDescriptors(1);
      database.ReadMatches(1, 2);
      database.VerifiedPairs(0);
      database.ReadTwoViewGeometry(1, 2);
    };
    EXPECT_NO_THROW(read_all());
    database.Execute("PRAGMA foreign_keys = OFF");
    database.Execute(damage.sql);
    EXPECT_THAT(read_all,
                ThrowsMessage<InputError>(
                    AllOf(HasSubstr("a.db"), HasSubstr(damage.message), HasSubstr("DELETE FROM"))));
  }
}

}  // namespace
}  // namespace holba
