// SPDX-License-Identifier: BSD-3-Clause
#include "holba/frontend/drawing/scene_raster.h"

#include <gtest/gtest.h>

#include <cstdlib>

namespace holba {
namespace {

constexpr int kSide = 60;
constexpr Rgb kRed = {255, 0, 0}, kGreen = {0, 255, 0}, kBlue = {0, 0, 255};

ColourImage WhiteSquare() {
  return {kSide, kSide, std::vector<uint8_t>(size_t{3} * kSide * kSide, 255)};
}

Rgb PixelOf(const ColourImage& image, int x, int y) {
  const uint8_t* p = &image.pixels[3 * (size_t(y) * image.width + x)];
  return {p[0], p[1], p[2]};
}

RasterPlace Place(double x, double y, double nearness) { return {{x, y}, nearness}; }

TEST(SceneRaster, WhatIsNearerHidesWhatIsBehindInWhateverOrder) {
  for (const bool near_first : {false, true}) {
    SceneRaster raster(WhiteSquare(), 0.0, 0.0);
    const auto add = [&](bool near) {
      raster.AddDot(Place(30.0, 30.0, near ? 2.0 : 1.0), 8.0, near ? kRed : kGreen);
    };
    add(near_first);
    add(!near_first);
    const ColourImage picture = raster.Render(1);
    EXPECT_EQ(PixelOf(picture, 30, 30), kRed);
    EXPECT_EQ(PixelOf(picture, 5, 5), (Rgb{255, 255, 255}));
  }
}

TEST(SceneRaster, TrianglesThatCutEachOtherShowTheNearerOneOnEachSide) {
  SceneRaster raster(WhiteSquare(), 0.0, 0.0);
  // One rises to the right, the other to the left; they meet amid the picture.
  const auto square = [&](double left, double right, const Rgb& colour) {
    const RasterPlace a = Place(0, 0, left), b = Place(kSide, 0, right),
                      c = Place(kSide, kSide, right), d = Place(0, kSide, left);
    raster.AddTriangle(a, b, c, colour, 1.0);
    raster.AddTriangle(a, c, d, colour, 1.0);
  };
  square(1.0, 2.0, kRed);
  square(2.0, 1.0, kBlue);
  const ColourImage picture = raster.Render(1);
  EXPECT_EQ(PixelOf(picture, 10, 20), kBlue);
  EXPECT_EQ(PixelOf(picture, 50, 20), kRed);
}

TEST(SceneRaster, ASurfaceOfTwoTrianglesHasNoSeam) {
  SceneRaster raster(WhiteSquare(), 0.0, 0.0);
  const RasterPlace a = Place(3.5, 4.5, 1), b = Place(55.5, 9.5, 1), c = Place(51.5, 56.5, 1),
                    d = Place(6.5, 50.5, 1);
  raster.AddTriangle(a, b, c, kRed, 0.5);
  raster.AddTriangle(a, c, d, kRed, 0.5);
  const ColourImage picture = raster.Render(1);
  // Along the diagonal that they share, as elsewhere inside: half red over white, once.
  for (int i = 12; i < 46; ++i) {
    const Rgb rgb = PixelOf(picture, i, i);
    EXPECT_EQ(rgb[0], 255);
    EXPECT_NEAR(rgb[1], 128, 1) << i;
  }
}

TEST(SceneRaster, ALineInATranslucentSurfaceIsSeenWhole) {
  SceneRaster raster(WhiteSquare(), 0.01, 0.0);
  raster.AddTriangle(Place(0, 0, 1), Place(200, 0, 1), Place(0, 200, 1), kRed, 0.5);
  raster.AddLine(Place(5, 30, 1.0), Place(55, 30, 1.0), 6.0, kBlue);
  // Behind it by more than the slack.
  raster.AddLine(Place(5, 45, 0.9), Place(55, 45, 0.9), 6.0, kBlue);
  const ColourImage picture = raster.Render(1);
  EXPECT_EQ(PixelOf(picture, 30, 30), kBlue);
  EXPECT_EQ(PixelOf(picture, 30, 45), (Rgb{128, 0, 128}));
}

TEST(SceneRaster, ALineThatPassesInFrontHasAHaloAndOneThatMeetsHasNone) {
  const auto centre_of_halo = [](double nearness_of_crossing) {
    SceneRaster raster(WhiteSquare(), 0.01, 0.0);
    raster.AddLine(Place(0, 30, 1.0), Place(kSide, 30, 1.0), 4.0, kBlue);
    raster.AddLine(Place(30, 0, nearness_of_crossing), Place(30, kSide, nearness_of_crossing), 4.0,
                   kRed, 4.0);
    return PixelOf(raster.Render(1), 34, 30);
  };
  EXPECT_EQ(centre_of_halo(2.0), (Rgb{255, 255, 255}));
  EXPECT_EQ(centre_of_halo(1.0), kBlue);
}

TEST(SceneRaster, ThePictureIsTheSameForAnyNumberOfThreads) {
  SceneRaster raster(WhiteSquare(), 0.004, 0.0);
  std::srand(1);
  const auto place = [] {
    return Place(std::rand() % 90 - 15, std::rand() % 90 - 15, 1.0 + std::rand() % 100);
  };
  for (int i = 0; i < 200; ++i) {
    const Rgb colour = {uint8_t(std::rand()), uint8_t(std::rand()), uint8_t(std::rand())};
    raster.AddDot(place(), 2.0, colour);
    raster.AddLine(place(), place(), 2.0, colour, 1.0);
    raster.AddTriangle(place(), place(), place(), colour, 0.3);
  }
  EXPECT_EQ(raster.Render(1).pixels, raster.Render(3).pixels);
}

}  // namespace
}  // namespace holba
