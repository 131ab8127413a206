// SPDX-License-Identifier: BSD-3-Clause
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "holba/base/error.h"
#include "holba/io/database_testing.h"
#include "holba/io/test_models.h"

namespace holba {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

PairRepetition Example() {
  return {.num_near = {900, 800},
          .num_repeated = {300, 200},
          .num_sampled = 256,
          .num_agreeing = 90,
          .num_undecided = 40,
          .band_px = {{12.5, 3.25}},
          .ratios = {0.5f, 0.75f, 1.0f}};
}

TEST(DatabaseRepetition, ComesBackForItsSettingsInEitherOrderOfTheImages) {
  const TestFolder folder;
  Database database(folder / "a.db");
  AddImages(3, &database);
  EXPECT_FALSE(database.ReadPairRepetition(1, 2, "s").has_value());
  database.WritePairRepetition(1, 2, "s", Example());
  EXPECT_EQ(database.ReadPairRepetitionSettings(2, 1), "s");
  EXPECT_FALSE(database.ReadPairRepetition(1, 2, "t").has_value());
  const PairRepetition read = *database.ReadPairRepetition(1, 2, "s");
  EXPECT_THAT(read.num_near, ElementsAre(900, 800));
  EXPECT_THAT(read.num_repeated, ElementsAre(300, 200));
  EXPECT_EQ(read.num_sampled, 256u);
  EXPECT_EQ(read.num_agreeing, 90u);
  EXPECT_EQ(read.num_undecided, 40u);
  EXPECT_THAT(*read.band_px, ElementsAre(12.5, 3.25));
  EXPECT_THAT(read.ratios, ElementsAre(0.5f, 0.75f, 1.0f));
  const PairRepetition turned = *database.ReadPairRepetition(2, 1, "s");
  EXPECT_THAT(turned.num_near, ElementsAre(800, 900));
  EXPECT_THAT(*turned.band_px, ElementsAre(3.25, 12.5));
  PairRepetition of_homography = Example();
  of_homography.band_px.reset();
  database.WritePairRepetition(3, 1, "s", of_homography);
  EXPECT_FALSE(database.ReadPairRepetition(1, 3, "s")->band_px.has_value());
  EXPECT_THAT(database.ReadPairRepetition(3, 1, "s")->num_near, ElementsAre(900, 800));
}

TEST(DatabaseRepetition, IsAddedToDatabasesThatHaveOurOtherTables) {
  const TestFolder folder;
  {
    Database database(folder / "a.db");
    AddImages(2, &database);
    database.WriteSegments(1, "s", RandomFeatures(1, 3).segments);
  }
  Database database(folder / "a.db");
  EXPECT_FALSE(database.ReadPairRepetitionSettings(1, 2).has_value());
  database.WritePairRepetition(1, 2, "s", Example());
  EXPECT_TRUE(database.ReadPairRepetition(1, 2, "s").has_value());
}

TEST(DatabaseRepetition, GoesWithItsImagesAndSaysWhichRowIsDamaged) {
  const TestFolder folder;
  Database database(folder / "a.db");
  AddImages(3, &database);
  database.WritePairRepetition(1, 2, "s", Example());
  database.WritePairRepetition(1, 3, "s", Example());
  for (const char* damage : {"near1 = -1", "agreeing = 300", "rows = 4", "band1_px = 9e999"}) {
    database.WritePairRepetition(1, 2, "s", Example());
    database.Execute("UPDATE holba_pair_repetition SET " + std::string(damage) +
                     " WHERE image_id2 = 2");
    EXPECT_THAT([&] { database.ReadPairRepetition(1, 2, "s"); },
                ThrowsMessage<InputError>(HasSubstr("image_id1 = 1 AND image_id2 = 2")))
        << damage;
  }
  database.Execute("DELETE FROM images WHERE image_id = 2");
  EXPECT_FALSE(database.ReadPairRepetitionSettings(1, 2).has_value());
  EXPECT_TRUE(database.ReadPairRepetition(1, 3, "s").has_value());
}

}  // namespace
}  // namespace holba
