// SPDX-License-Identifier: BSD-3-Clause
// Pictures of images and pairs: everything is where the features are, at the scale of the picture,
// and each row has what its name says.
#include "holba/frontend/drawing/pair_pictures.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace holba {
namespace {

constexpr int kSize = 400, kGap = 6, kCaption = 26;

// 800 x 600 pixels, on white.
ShownImage Empty(const std::string& name) {
  ShownImage image;
  image.name = name;
  image.width = 800;
  image.height = 600;
  return image;
}

bool IsWhite(const ColourImage& image, int x, int y) {
  const uint8_t* p = &image.pixels[3 * (size_t(y) * image.width + x)];
  return p[0] == 255 && p[1] == 255 && p[2] == 255;
}

// Of the pixels of a part that are not white: how many, and the box that they fill.
struct Ink {
  int num = 0, left = 1 << 30, right = -1, top = 1 << 30, bottom = -1;
};
Ink InkIn(const ColourImage& image, int left, int top, int right, int bottom) {
  Ink ink;
  for (int y = top; y < bottom; ++y) {
    for (int x = left; x < right; ++x) {
      if (IsWhite(image, x, y)) continue;
      ++ink.num;
      ink.left = std::min(ink.left, x);
      ink.right = std::max(ink.right, x);
      ink.top = std::min(ink.top, y);
      ink.bottom = std::max(ink.bottom, y);
    }
  }
  return ink;
}

TEST(PairPictures, FeaturesAreDrawnWhereTheyAreAtTheScaleOfThePicture) {
  ShownImage image = Empty("a");
  image.segments = {{{100, 200}, {500, 200}}};
  const ColourImage picture = DrawImageFeatures(image, kSize);
  EXPECT_EQ(picture.width, kSize);
  EXPECT_EQ(picture.height, 300 + kCaption);
  // Half as large; the segment and nothing else lies below the caption.
  const Ink ink = InkIn(picture, 0, kCaption, picture.width, picture.height);
  EXPECT_NEAR(ink.left, 50, 2);
  EXPECT_NEAR(ink.right, 250, 2);
  EXPECT_NEAR(ink.top, kCaption + 100, 2);
  EXPECT_NEAR(ink.bottom, kCaption + 100, 2);
  EXPECT_GT(InkIn(picture, 0, 0, picture.width, kCaption).num, 50);
}

TEST(PairPictures, APhotographIsNeverEnlarged) {
  ShownImage image = Empty("a");
  image.photograph = {200, 150, std::vector<uint8_t>(3 * 200 * 150, 10)};
  image.points = {{400, 300}};
  const ColourImage picture = DrawImageFeatures(image, 1000);
  EXPECT_EQ(picture.width, 200);
  EXPECT_EQ(picture.height, 150 + kCaption);
}

TEST(PairPictures, HaveARowForEachKindOfMatchThatIsThere) {
  ShownImage image1 = Empty("a"), image2 = Empty("b");
  image1.points = image2.points = {{200, 100}, {400, 500}};
  image1.segments = image2.segments = {{{600, 100}, {600, 300}}};
  const int row = 300 + kCaption;
  ShownPair pair;
  EXPECT_EQ(DrawImagePair(image1, image2, pair, kSize).height, row);
  pair.inliers = {{0, 0}};
  EXPECT_EQ(DrawImagePair(image1, image2, pair, kSize).height, 2 * row);
  pair.rejected = {{1, 0}};
  pair.segments = {{0, 0, 0.1f}};
  const ColourImage picture = DrawImagePair(image1, image2, pair, kSize);
  EXPECT_EQ(picture.height, 4 * row);
  EXPECT_EQ(picture.width, 2 * kSize + kGap);

  // The inlier runs level from one image to the other.
  const Ink inliers = InkIn(picture, 0, row + kCaption, picture.width, 2 * row);
  EXPECT_NEAR(inliers.left, 100, 3);
  EXPECT_NEAR(inliers.right, kSize + kGap + 100, 3);
  EXPECT_NEAR(inliers.top, row + kCaption + 50, 3);
  EXPECT_NEAR(inliers.bottom, row + kCaption + 50, 3);
  // The rejected match goes up, from the second point to the first.
  const Ink rejected = InkIn(picture, 0, 2 * row + kCaption, picture.width, 3 * row);
  EXPECT_NEAR(rejected.left, 200, 3);
  EXPECT_NEAR(rejected.bottom, 2 * row + kCaption + 250, 3);
  EXPECT_NEAR(rejected.top, 2 * row + kCaption + 50, 3);
  const Ink segments = InkIn(picture, 0, 3 * row + kCaption, picture.width, 4 * row);
  EXPECT_NEAR(segments.left, 300, 3);
  EXPECT_NEAR(segments.top, 3 * row + kCaption + 50, 3);
  EXPECT_NEAR(segments.bottom, 3 * row + kCaption + 150, 3);
}

TEST(PairPictures, MatchesOfFeaturesThatAreNotThereAreLeftOut) {
  ShownImage image = Empty("a");
  ShownPair pair;
  pair.inliers = {{3, 0}};
  pair.segments = {{0, 5, 0.1f}};
  const ColourImage picture = DrawImagePair(image, image, pair, kSize);
  const int row = 300 + kCaption;
  for (int i = 0; i < 3; ++i)
    EXPECT_EQ(InkIn(picture, 0, i * row + kCaption, picture.width, (i + 1) * row).num, 0);
}

TEST(PairPictures, CaptionsAreMadeSmallerUntilTheyFit) {
  const ColourImage picture = DrawImageFeatures(Empty(std::string(200, 'M')), kSize);
  const Ink ink = InkIn(picture, 0, 0, kSize, kCaption);
  EXPECT_GT(ink.num, 0);
  EXPECT_GT(ink.right, kSize / 2);
  EXPECT_LT(ink.right, kSize - 1);
}

}  // namespace
}  // namespace holba
