// SPDX-License-Identifier: BSD-3-Clause
// Our tables of a Database: what is written comes back whole, for the settings it was made with; it
// goes with its image; damage is reported.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "holba/base/check.h"
#include "holba/base/error.h"
#include "holba/io/database_testing.h"
#include "holba/io/test_models.h"

namespace holba {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

int64_t Count(const std::filesystem::path& path, const std::string& table) {
  // Rows without our functions: a CHECK that fails tells the number.
  Database database(path);
  int64_t num = -1;
  for (int64_t guess = 0; guess < 20 && num < 0; ++guess) {
    try {
      database.Execute("CREATE TEMP TABLE IF NOT EXISTS probe(n INTEGER CHECK(n = " +
                       std::to_string(guess) + "))");
      database.Execute("INSERT INTO probe SELECT COUNT(*) FROM " + table);
      num = guess;
    } catch (const InputError&) {
    }
    database.Execute("DROP TABLE IF EXISTS probe");
  }
  return num;
}

constexpr const char* kOurTables[] = {"holba_segments",    "holba_segment_descriptors",
                                      "holba_corners",     "holba_vanishing_points",
                                      "holba_label_maps",  "holba_normals",
                                      "holba_line_matches"};

const std::vector<LineMatch> kMatches = {{0, 6, 0.25f}, {0, 1, 0.5f}, {4, 2, -1.0f}};

// Three images with everything, and line matches of every pair.
void Fill(Database* database) {
  AddImages(3, database);
  for (image_t id = 1; id <= 3; ++id) WriteAll(id, "lsd", RandomFeatures(id, 7), database);
  database->WriteLineMatches(1, 2, "m", kMatches);
  database->WriteLineMatches(3, 1, "m", kMatches);
  database->WriteLineMatches(2, 3, "m", {});
}

TEST(DatabaseFeatures, ComeBackBitForBit) {
  const TestFolder folder;
  {
    Database database(folder / "a.db");
    Fill(&database);
  }
  const Database database(folder / "a.db");
  for (image_t id = 1; id <= 3; ++id) {
    const ImageFeatures wanted = RandomFeatures(id, 7);
    const auto segments = *database.ReadSegments(id, "lsd");
    ASSERT_EQ(segments.size(), wanted.segments.size());
    for (size_t i = 0; i < segments.size(); ++i) {
      EXPECT_EQ(segments[i].start, wanted.segments[i].start);
      EXPECT_EQ(segments[i].end, wanted.segments[i].end);
    }
    EXPECT_EQ(database.ReadSegmentDescriptors(id, "lsd"), wanted.segment_descriptors);
    const auto corners = *database.ReadCorners(id, "lsd");
    EXPECT_EQ(corners.positions, wanted.corners);
    EXPECT_EQ(corners.descriptors, wanted.corner_descriptors);
    const auto vps = *database.ReadVanishingPoints(id, "lsd");
    ASSERT_EQ(vps.points.size(), 3u);
    for (size_t i = 0; i < 3; ++i) {
      EXPECT_EQ(vps.points[i].direction_in_cam, wanted.vanishing_points[i].direction_in_cam);
      EXPECT_EQ(vps.points[i].num_segments, i);
    }
    EXPECT_EQ(vps.vp_of_segment, wanted.vp_of_segment);
    const auto map = *database.ReadLabelMap(id, "lsd");
    EXPECT_EQ(map.width, 40);
    EXPECT_EQ(map.height, 30);
    EXPECT_EQ(map.labels, wanted.label_map.labels);
    EXPECT_EQ(map.types, wanted.label_map.types);
    const auto normals = *database.ReadNormals(id, "lsd");
    ASSERT_EQ(normals.size(), 2u);
    EXPECT_EQ(normals.at(1).normal_in_cam, wanted.normals.at(1).normal_in_cam);
    EXPECT_EQ(normals.at(1).sigma_deg, 2.5);
  }
  const auto matches = *database.ReadLineMatches(1, 2, "m");
  ASSERT_EQ(matches.size(), 3u);
  const auto turned = *database.ReadLineMatches(2, 1, "m");
  const auto written_turned = *database.ReadLineMatches(3, 1, "m");
  for (size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(matches[i].idx1, kMatches[i].idx1);
    EXPECT_EQ(matches[i].idx2, kMatches[i].idx2);
    EXPECT_EQ(matches[i].distance, kMatches[i].distance);
    EXPECT_EQ(turned[i].idx1, kMatches[i].idx2);
    EXPECT_EQ(turned[i].idx2, kMatches[i].idx1);
    EXPECT_EQ(written_turned[i].idx1, kMatches[i].idx1);
    EXPECT_EQ(written_turned[i].idx2, kMatches[i].idx2);
  }
  EXPECT_TRUE(database.ReadLineMatches(2, 3, "m")->empty());
}

TEST(DatabaseFeatures, OfNothingAreSomethingElseThanNothing) {
  const TestFolder folder;
  Database database(folder / "a.db");
  AddImages(1, &database);
  EXPECT_EQ(CountParts(database, 1, "s"), 0);
  EXPECT_FALSE(database.ReadLineMatches(1, 2, "s").has_value());
  WriteAll(1, "s", {}, &database);
  EXPECT_EQ(CountParts(database, 1, "s"), 6);
  EXPECT_TRUE(database.ReadSegments(1, "s")->empty());
  EXPECT_TRUE(database.ReadCorners(1, "s")->descriptors.empty());
  EXPECT_TRUE(database.ReadLabelMap(1, "s")->empty());
}

TEST(DatabaseFeatures, AreThereOnlyForTheSettingsTheyWereMadeWith) {
  const TestFolder folder;
  Database database(folder / "a.db");
  Fill(&database);
  EXPECT_EQ(CountParts(database, 1, "lsd"), 6);
  EXPECT_EQ(CountParts(database, 1, "LSD"), 0);
  EXPECT_EQ(CountParts(database, 1, ""), 0);
  EXPECT_FALSE(database.ReadLineMatches(1, 2, "n").has_value());
  // What is replaced is gone, with whatever settings.
  database.WriteCorners(1, "b", {});
  EXPECT_FALSE(database.ReadCorners(1, "lsd").has_value());
  EXPECT_TRUE(database.ReadCorners(1, "b").has_value());
}

TEST(DatabaseFeatures, OfOldSegmentsGoWithThem) {
  const TestFolder folder;
  Database database(folder / "a.db");
  Fill(&database);
  database.WriteSegments(1, "lsd", RandomFeatures(9, 2).segments);
  EXPECT_FALSE(database.ReadSegmentDescriptors(1, "lsd").has_value());
  EXPECT_FALSE(database.ReadVanishingPoints(1, "lsd").has_value());
  EXPECT_TRUE(database.ReadCorners(1, "lsd").has_value());
  EXPECT_FALSE(database.ReadLineMatches(1, 2, "m").has_value());
  EXPECT_FALSE(database.ReadLineMatches(1, 3, "m").has_value());
  EXPECT_TRUE(database.ReadLineMatches(2, 3, "m").has_value());
  EXPECT_EQ(CountParts(database, 2, "lsd"), 6);
}

TEST(DatabaseFeatures, GoWithTheirImage) {
  const TestFolder folder;
  const auto path = folder / "a.db";
  {
    Database database(path);
    Fill(&database);
  }
  for (const char* table : kOurTables) EXPECT_EQ(Count(path, table), 3) << table;
  Database(path).Execute("DELETE FROM images WHERE image_id = 2");
  for (const char* table : kOurTables) {
    EXPECT_EQ(Count(path, table), std::string(table) == "holba_line_matches" ? 1 : 2) << table;
  }
  EXPECT_TRUE(Database(path).ReadLineMatches(1, 3, "m").has_value());
  Database(path).Execute("DELETE FROM images");
  for (const char* table : kOurTables) EXPECT_EQ(Count(path, table), 0) << table;
}

TEST(DatabaseFeatures, NeedTheirImageAndTheirSegments) {
  const TestFolder folder;
  Database database(folder / "a.db");
  Fill(&database);
  EXPECT_THROW(database.WriteSegments(4, "", {}), InputError);
  EXPECT_FALSE(database.ReadSegments(4, "").has_value());
  EXPECT_THROW(database.WriteSegmentDescriptors(1, "", std::vector<float>(6 * 72)), CheckError);
  EXPECT_THROW(database.WriteVanishingPoints(1, "", {{}, {-1, -1}}), CheckError);
  EXPECT_THROW(database.WriteLineMatches(1, 2, "", {{7, 0, 0.0f}}), CheckError);
  EXPECT_THROW(database.WriteLineMatches(2, 1, "", {{0, 7, 0.0f}}), CheckError);
  EXPECT_EQ(CountParts(database, 1, "lsd"), 6);
}

TEST(DatabaseFeatures, SayWhichRowIsDamaged) {
  struct Damage {
    const char* table;
    const char* change;
    const char* message;
  };
  const Damage damages[] = {
      {"holba_segments", "rows = 8", "expected 8 segments of 4 doubles, found 224 bytes"},
      {"holba_segments", "rows = -1", "expected -1 segments"},
      {"holba_segments", "rows = 576460752303423495", "expected 576460752303423495 segments"},
      {"holba_segments", "data = x'00'", "found 1 bytes"},
      {"holba_segments", "data = 'abc'", "found 3 bytes"},
      {"holba_segments", "rows = 1, data = zeroblob(32)", "segment 0 has no length"},
      {"holba_segments",
       "rows = 1, data = x'000000000000F07F000000000000000000000000000000000000000000000000'",
       "segment 0 are not finite"},
      {"holba_segment_descriptors", "rows = 6", "expected 6 descriptors"},
      {"holba_segment_descriptors", "rows = 6, data = zeroblob(1728)",
       "has 7 segments, found descriptors of 6"},
      {"holba_segment_descriptors", "data = CAST(x'0000C07F' || zeroblob(2012) AS BLOB)",
       "not a finite number"},
      {"holba_corners", "rows = 4", "expected 4 corners"},
      {"holba_corners", "descriptors = x'00'", "expected 5 descriptors"},
      {"holba_vanishing_points", "data = zeroblob(72)", "direction 0 has length 0"},
      {"holba_vanishing_points", "rows = 2, data = CAST(substr(data, 1, 48) AS BLOB)",
       "expected 2 counts"},
      {"holba_vanishing_points", "support = x''", "expected 3 counts"},
      {"holba_vanishing_points", "num_segments = 6", "expected 6 labels"},
      {"holba_vanishing_points", "num_segments = 6, vp_of_segment = zeroblob(24)",
       "has 7 segments, found labels of 6"},
      {"holba_vanishing_points", "vp_of_segment = CAST(x'03000000' || zeroblob(24) AS BLOB)",
       "label 3, expected -1 to 2"},
      {"holba_vanishing_points", "vp_of_segment = CAST(x'FEFFFFFF' || zeroblob(24) AS BLOB)",
       "label -2, expected -1 to 2"},
      {"holba_label_maps", "width = 41", "do not fill 41 x 30"},
      {"holba_label_maps", "width = 39", "do not fill 39 x 30"},
      {"holba_label_maps", "width = -1", "too large"},
      {"holba_label_maps", "width = 100000, height = 100000", "too large"},
      {"holba_label_maps", "data = x''", "do not fill"},
      {"holba_label_maps", "data = x'0100'", "do not fill"},
      {"holba_label_maps", "data = x'0100FFFFFFFFFFFFFFFFFFFF01'", "do not fill"},
      {"holba_label_maps", "data = x'010080'", "do not fill"},
      {"holba_label_maps", "data = x'010000'", "do not fill"},
      {"holba_label_maps", "types = '1 PYRAMID'", "found '1 PYRAMID'"},
      {"holba_label_maps", "types = '65536 PLANE'", "found '65536 PLANE'"},
      {"holba_label_maps", "types = 'PLANE'", "found 'PLANE'"},
      {"holba_normals", "rows = 3", "expected 3 labels"},
      {"holba_normals", "data = zeroblob(64)", "expected a unit normal"},
      {"holba_normals", "labels = zeroblob(4)", "label 0 has two normals"},
      {"holba_normals", "data = x'00'", "expected 2 normals"},
      {"holba_line_matches", "rows = 2", "expected 2 pairs"},
      {"holba_line_matches", "distances = x'00'", "expected 3 floats"},
      {"holba_line_matches", "data = CAST(x'07000000' || zeroblob(20) AS BLOB)",
       "names segments 7 and 0, the images have 7 and 7"},
      {"holba_line_matches", "distances = x'0000C07F0000000000000000'", "not a finite number"},
  };
  const TestFolder folder;
  Database database(folder / "a.db");
  Fill(&database);
  for (const Damage& damage : damages) {
    SCOPED_TRACE(std::string(damage.table) + " " + damage.change);
    Database::Transaction undone(&database);
    const bool of_pair = std::string(damage.table) == "holba_line_matches";
    database.Execute(std::string("UPDATE ") + damage.table + " SET " + damage.change + " WHERE " +
                     (of_pair ? "image_id1 = 1 AND image_id2 = 2" : "image_id = 1"));
    const auto read = [&] {
      CountParts(database, 1, "lsd");
      database.ReadLineMatches(1, 2, "m");
    };
    EXPECT_THAT(read, ThrowsMessage<InputError>(AllOf(
                          HasSubstr("a.db: table " + std::string(damage.table) + ", image_id"),
                          HasSubstr(damage.message),
                          HasSubstr(std::string("DELETE FROM ") + damage.table + " WHERE"))));
    EXPECT_EQ(CountParts(database, 2, "lsd"), 6);
  }
  EXPECT_EQ(CountParts(database, 1, "lsd"), 6);
}

// Bytes turned at random never crash a reader, whatever it makes of them.
TEST(DatabaseFeatures, SurviveAnyBytes) {
  const TestFolder folder;
  Database database(folder / "a.db");
  Fill(&database);
  Random random(5);
  int num_refused = 0;
  for (int i = 0; i < 300; ++i) {
    std::string bytes = "x'";
    for (uint64_t n = random.Index(60); n > 0; --n) {
      const uint64_t byte = random.Index(4) == 0 ? random.Index(256) : random.Index(3);
      bytes += "0123456789ABCDEF"[byte / 16];
      bytes += "0123456789ABCDEF"[byte % 16];
    }
    Database::Transaction undone(&database);
    database.Execute("UPDATE holba_label_maps SET data = " + bytes +
                     "', width = " + std::to_string(random.Index(8)) +
                     ", height = " + std::to_string(random.Index(8)));
    try {
      const auto map = database.ReadLabelMap(1, "lsd");
      EXPECT_EQ(map->labels.size(), static_cast<size_t>(map->width * map->height));
    } catch (const InputError&) {
      ++num_refused;
    }
  }
  EXPECT_GT(num_refused, 100);
}

TEST(DatabaseFeatures, AreSmallForMapsOfLargeRegions) {
  const TestFolder folder;
  const auto path = folder / "a.db";
  LabelMap map{2000, 1500, std::vector<uint16_t>(3000000, 3), {}};
  std::fill(map.labels.begin() + 1000000, map.labels.end(), 4);
  {
    Database database(path);
    AddImages(1, &database);
    database.WriteLabelMap(1, "", map);
    EXPECT_EQ(database.ReadLabelMap(1, "")->labels, map.labels);
  }
  EXPECT_LT(std::filesystem::file_size(path), 300000u);
}

}  // namespace
}  // namespace holba
