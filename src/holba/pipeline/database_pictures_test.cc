// SPDX-License-Identifier: BSD-3-Clause
#include "holba/pipeline/database_pictures.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

#include "holba/base/error.h"
#include "holba/pipeline/pipeline_testing.h"

namespace holba {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

// Of three photographs; the first two have matches.
class DatabasePictures : public PipelineTest {
 protected:
  void SetUp() override {
    PipelineTest::SetUp();
    database_ = std::make_unique<Database>(folder_ / "database.db");
    database_->AddCamera(1, {model_.cameras.at(1), true});
    for (const image_t id : kIds) {
      database_->AddImage(id, {std::to_string(id) + ".png", 1});
      database_->WriteKeypoints(id, {2, {50, 60, 120, 90}});
      database_->WriteSegments(id, "any", {{{20, 30}, {20, 100}}, {{90, 30}, {90, 100}}});
    }
    database_->WriteMatches(3, 5, {{0, 0}, {1, 1}});
    TwoViewGeometry geometry;
    geometry.config = TwoViewConfig::kCalibrated;
    geometry.inlier_matches = {{0, 0}};
    database_->WriteTwoViewGeometry(3, 5, geometry);
    database_->WriteLineMatches(3, 5, "however made", {{0, 0, 0.1f}, {1, 0, 0.9f}});
  }

  std::unique_ptr<Database> database_;
};

TEST_F(DatabasePictures, HaveARowForFeaturesInliersRejectedMatchesAndSegments) {
  const int row = kHeight + 26;
  EXPECT_EQ(DrawDatabaseImages(*database_, {"3.png", "5.png"}, folder_, 1000).height, 4 * row);
  EXPECT_EQ(DrawDatabaseImages(*database_, {"3.png", "5.png"}, folder_, 1000).width,
            2 * kWidth + 6);
  // In the other order, too, and without photographs.
  EXPECT_EQ(DrawDatabaseImages(*database_, {"5.png", "3.png"}, std::nullopt, 1000).height, 4 * row);
  EXPECT_EQ(DrawDatabaseImages(*database_, {"3.png", "8.png"}, folder_, 1000).height, row);
  EXPECT_EQ(DrawDatabaseImages(*database_, {"8.png"}, folder_, 1000).width, kWidth);
}

TEST_F(DatabasePictures, NamesMayHaveCommas) {
  database_->AddImage(20, {"a,b.png", 1});
  EXPECT_THAT(NamedImages(*database_, "3.png,5.png"), ElementsAre("3.png", "5.png"));
  EXPECT_THAT(NamedImages(*database_, "a,b.png"), ElementsAre("a,b.png"));
  EXPECT_THAT(NamedImages(*database_, "a,b.png,3.png"), ElementsAre("a,b.png", "3.png"));
  EXPECT_THAT([&] { NamedImages(*database_, "3.png,4.png"); },
              ThrowsMessage<InputError>(HasSubstr("no image '4.png'; see")));
  EXPECT_THAT([&] { NamedImages(*database_, "3.png,3.png"); },
              ThrowsMessage<InputError>(HasSubstr("named twice; give")));
}

TEST_F(DatabasePictures, AreWrittenWholeOrNotAtAll) {
  const ColourImage picture = DrawDatabaseImages(*database_, {"3.png"}, folder_, 1000);
  WritePicture(picture, folder_ / "new" / "a.png");
  EXPECT_EQ(ReadColourImage(folder_ / "new" / "a.png").pixels, picture.pixels);
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder_ / "new"), {}), 1);
  EXPECT_THROW(ProbePicture(folder_ / "a.gif"), InputError);
  EXPECT_THROW(DrawDatabaseImages(*database_, {"3.png"}, folder_ / "nowhere", 1000), InputError);
}

}  // namespace
}  // namespace holba
