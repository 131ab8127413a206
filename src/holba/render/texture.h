// SPDX-License-Identifier: BSD-3-Clause
// Textures: colours in metres, repeated without end, with smaller versions of themselves (Williams
// 1983) so that far surfaces neither flicker nor alias.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <vector>

namespace holba {

using Colour = Eigen::Vector3f;  // linear light, per channel

float LinearFromSrgb(float value);  // both in 0 to 1
float SrgbFromLinear(float value);
// Of the usual numbers of 0 to 255.
Colour ColourOf(int red, int green, int blue);

// While it is painted.
class Canvas {
 public:
  // Of the size in metres, as near as whole texels come to it.
  Canvas(double width, double height, double metres_per_texel, const Colour& colour);

  int columns() const { return columns_; }
  int rows() const { return rows_; }
  double metres_per_texel() const { return metres_per_texel_; }
  double width() const { return columns_ * metres_per_texel_; }
  double height() const { return rows_ * metres_per_texel_; }
  // Indices outside go round.
  Colour& At(int column, int row);

  // Each texel's colour by `change(x, y, colour*)`, x and y in metres at its centre.
  template <typename Change>
  void ForAll(const Change& change) {
    ForBox(0.0, 0.0, width(), height(), change);
  }
  // Of the texels whose centres are in a box; it goes round at the rims.
  template <typename Change>
  void ForBox(double x, double y, double box_width, double box_height, const Change& change) {
    const auto first = [this](double metres) {
      return static_cast<int>(std::ceil(metres / metres_per_texel_ - 0.5));
    };
    for (int row = first(y); row < first(y + box_height); ++row) {
      for (int column = first(x); column < first(x + box_width); ++column) {
        change((column + 0.5) * metres_per_texel_, (row + 0.5) * metres_per_texel_,
               &At(column, row));
      }
    }
  }
  void Rectangle(double x, double y, double width, double height, const Colour& colour);
  void Disc(double x, double y, double radius, const Colour& colour);

 private:
  int columns_, rows_;
  double metres_per_texel_;
  std::vector<Colour> texels_;
};

class Texture {
 public:
  explicit Texture(Canvas canvas);

  // Of a patch `footprint` metres wide about (x, y) metres.
  Colour At(double x, double y, double footprint) const;

 private:
  struct Level {
    int columns, rows;
    std::vector<std::array<uint8_t, 3>> texels;  // sRGB: fine enough steps in the dark
  };
  Colour OfLevel(const Level& level, double column, double row) const;

  double metres_per_texel_;
  std::vector<Level> levels_;
};

}  // namespace holba
