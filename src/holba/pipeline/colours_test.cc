// SPDX-License-Identifier: BSD-3-Clause
#include "holba/pipeline/colours.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "holba/frontend/photographs/photograph.h"

namespace holba {
namespace {

ColourImage Plain(uint8_t r, uint8_t g, uint8_t b) {
  ColourImage image{20, 10, {}};
  for (int i = 0; i < 200; ++i) image.pixels.insert(image.pixels.end(), {r, g, b});
  return image;
}

TEST(ColourFeatures, AreTheMeanOverTheImagesOfATrack) {
  const std::filesystem::path folder =
      std::filesystem::path(::testing::TempDir()) / "holba_colours_test";
  std::filesystem::create_directories(folder);
  WriteImage(Plain(10, 20, 30), folder / "1.png");
  WriteImage(Plain(30, 60, 91), folder / "2.png");

  Reconstruction model;
  model.cameras.Add(1, {FindCameraModel("SIMPLE_PINHOLE"), 20, 10, {20, 10, 5}});
  for (image_t id = 1; id <= 2; ++id) {
    Image image;
    image.name = std::to_string(id) + ".png";
    image.camera_id = 1;
    // The second point of the second image lies outside, on no pixel.
    image.points2D = {{{3.5, 4.5}, 1}, {{id == 1 ? 5.0 : 30.0, 5.0}, 2}};
    image.lines2D = {{{{1, 1}, {15, 8}}, 1}};
    model.images.Add(id, image);
  }
  model.AddTrivialRigsAndFrames();
  for (point3D_t id = 1; id <= 2; ++id) {
    const auto idx = static_cast<point2D_t>(id - 1);
    model.points3D.Add(id, {.rgb = {7, 7, 7}, .track = {{1, idx}, {2, idx}}});
  }
  Line3D line;
  line.track = {{1, 0}, {2, 0}};
  model.lines3D.Add(1, line);

  const std::vector<point3D_t> wanted = {1};
  ColourFeatures(folder, wanted, 2, &model);
  EXPECT_THAT(model.points3D.at(1).rgb, testing::ElementsAre(20, 40, 61));
  EXPECT_THAT(model.points3D.at(2).rgb, testing::ElementsAre(7, 7, 7));  // not asked for
  EXPECT_THAT(model.lines3D.at(1).rgb, testing::ElementsAre(20, 40, 61));
  const std::vector<point3D_t> outside = {2};
  ColourFeatures(folder, outside, 1, &model);
  EXPECT_THAT(model.points3D.at(2).rgb, testing::ElementsAre(20, 40, 61));  // the nearest pixel
  std::filesystem::remove_all(folder);
}

}  // namespace
}  // namespace holba
