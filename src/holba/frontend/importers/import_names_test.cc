// SPDX-License-Identifier: BSD-3-Clause
#include "holba/frontend/importers/import_names.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "holba/frontend/importers/import_testing.h"

namespace holba {
namespace {

using testing::HasSubstr;

TEST(ImageNames, NamesOfAFileArePairedByTheEndsOfTheirPathsAfterTheyAreLearnt) {
  ImageNames names(SmallImportModel());  // 1: dir/a.jpg, 2: b.jpg, 3: c.jpg
  EXPECT_EQ(names.Find("set/B.png"), std::nullopt);
  names.Learn(std::vector<std::string>{"a.jpg", "set/B.png", "c.jpg"});
  EXPECT_EQ(names.Find("a.jpg"), 1u);
  EXPECT_EQ(names.Find("set/B.png"), 2u);
  EXPECT_EQ(names.Find("c.jpg"), 3u);
  EXPECT_EQ(names.Find("d.jpg"), std::nullopt);
}

TEST(ImageNames, AnImageThatAnotherNameMeansIsNotPairedASecondTime) {
  ImageNames names(SmallImportModel());
  names.Learn(std::vector<std::string>{"b.jpg", "other/b.jpg", "x/c.jpg", "y/c.jpg"});
  EXPECT_EQ(names.Find("other/b.jpg"), std::nullopt);
  EXPECT_EQ(names.Find("x/c.jpg"), std::nullopt);  // as well as y/c.jpg
  EXPECT_EQ(names.Find("y/c.jpg"), std::nullopt);
}

TEST(ImageNames, PairsAreLearntWhereThereIsOneWayToCutThem) {
  ImageNames names(SmallImportModel());
  names.LearnFromPairs(std::vector<std::string>{"B.png C.png", "one two three"}, true);
  EXPECT_EQ(names.FindPairOfWords("B.png C.png"), std::make_pair(image_t{2}, image_t{3}));
  EXPECT_EQ(names.FindPairOfWords("one two three"), std::nullopt);
  EXPECT_EQ(names.FindPair("a.tif/B.png", "file"), std::nullopt);
  names.LearnFromPairs(std::vector<std::string>{"a.tif/B.png"}, false);
  EXPECT_EQ(names.FindPair("a.tif/B.png", "file"), std::make_pair(image_t{1}, image_t{2}));
}

TEST(ImageNames, DashesOfHlocsNamesMayStandForSlashes) {
  ImageNames names(SmallImportModel());
  EXPECT_EQ(names.FindPair("dir-a.jpg/b.jpg", "file"), std::make_pair(image_t{1}, image_t{2}));
  EXPECT_EQ(names.FindPair("set-dir-a.png/set-b.png", "file"), std::nullopt);
  names.LearnFromPairs(std::vector<std::string>{"set-dir-a.png/set-b.png", "dir-a.jpg/C.png"},
                       false);
  // 1 is dir-a.jpg, as it is.
  EXPECT_EQ(names.FindPair("dir-a.jpg/C.png", "file"), std::make_pair(image_t{1}, image_t{3}));
  EXPECT_EQ(names.FindPair("dir-a.jpg/set-b.png", "file"), std::make_pair(image_t{1}, image_t{2}));
  EXPECT_EQ(names.FindPair("set-dir-a.png/set-b.png", "file"), std::nullopt);
  ImageNames others(SmallImportModel());
  others.LearnFromPairs(std::vector<std::string>{"set-dir-a.png/set-b.png"}, false);
  EXPECT_EQ(others.FindPair("set-b.png/set-dir-a.png", "file"),
            std::make_pair(image_t{2}, image_t{1}));
}

TEST(ImageNames, WhatIsUnknownIsSaidWithANameOfEach) {
  const ImageNames names(SmallImportModel());
  EXPECT_EQ(std::string(names.NothingKnown("m.h5", 1, "pair", "x/y").what()),
            "m.h5: none of its names (1 pair) is in the model; expected names like 'dir/a.jpg', "
            "found 'x/y'");
}

}  // namespace
}  // namespace holba
