// SPDX-License-Identifier: BSD-3-Clause
// Textures of man-made places by recipe. All are random by their seed and repeat without a seam.
#pragma once

#include <cstdint>

#include "holba/render/texture.h"

namespace holba {

// Sum of `octaves` of smooth noise, each of half the wavelength and amplitude; about -1 to 1, mean
// 0. It repeats every `width` by `height`; the first octave has `cells` waves along the width.
class SmoothNoise {
 public:
  SmoothNoise(double width, double height, int cells_x, int cells_y, int octaves, uint64_t seed);
  float At(double x, double y) const;

 private:
  double width_, height_;
  int cells_x_, cells_y_, octaves_;
  uint64_t seed_;
};

// One colour, no detail.
Texture PlainTexture(const Colour& colour);
// Painted plaster: faint clouds, grain and some marks. contrast 1: as on old walls; 0.2: fresh
// paint.
Texture PlasterTexture(const Colour& colour, double contrast, uint64_t seed);
// Boards along x with grain, joints and knots; board_width 0: one piece.
Texture WoodTexture(const Colour& colour, double board_width, uint64_t seed);
// Square tiles with joints, in two colours like a chessboard or by chance.
Texture TileTexture(const Colour& first, const Colour& second, double tile, bool chessboard,
                    uint64_t seed);
// Courses of bricks, or of larger stones, in running bond.
Texture BrickTexture(const Colour& brick, const Colour& mortar, double length, double height,
                     uint64_t seed);
// Concrete, asphalt, stone: clouds at all scales, stains, grains.
Texture StoneTexture(const Colour& colour, double contrast, uint64_t seed);
// Woven cloth, with stripes of a second colour if they differ.
Texture ClothTexture(const Colour& first, const Colour& second, uint64_t seed);
// A carpet with borders and figures, not repeated: of that size in metres.
Texture CarpetTexture(double width, double height, uint64_t seed);
// Stripes with flowers.
Texture WallpaperTexture(const Colour& ground, const Colour& figure, uint64_t seed);
// A picture as it hangs on walls, in its mount; of that size.
Texture PictureTexture(double width, double height, uint64_t seed);
// Printed matter: heading, columns of lines, a picture. Text is strokes that no one can read.
Texture PosterTexture(double width, double height, uint64_t seed);
// Backs of books, side by side over the width.
Texture BooksTexture(double width, double height, uint64_t seed);
// A trading label for tins and boxes.
Texture LabelTexture(double width, double height, uint64_t seed);

}  // namespace holba
