// SPDX-License-Identifier: BSD-3-Clause
#include "holba/render/texture.h"

#include <algorithm>
#include <cmath>

namespace holba {
namespace {

int Wrapped(int i, int size) {
  const int rest = i % size;
  return rest < 0 ? rest + size : rest;
}

const std::array<float, 256>& LinearOfBytes() {
  static const std::array<float, 256> table = [] {
    std::array<float, 256> values;
    for (size_t i = 0; i < values.size(); ++i) {
      values[i] = LinearFromSrgb(static_cast<float>(i) / 255.0f);
    }
    return values;
  }();
  return table;
}

std::array<uint8_t, 3> ToBytes(const Colour& colour) {
  std::array<uint8_t, 3> bytes;
  for (int i = 0; i < 3; ++i) {
    bytes[static_cast<size_t>(i)] = static_cast<uint8_t>(
        std::lround(255.0f * SrgbFromLinear(std::clamp(colour[i], 0.0f, 1.0f))));
  }
  return bytes;
}

}  // namespace

float LinearFromSrgb(float value) {
  return value <= 0.04045f ? value / 12.92f : std::pow((value + 0.055f) / 1.055f, 2.4f);
}

float SrgbFromLinear(float value) {
  return value <= 0.0031308f ? 12.92f * value : 1.055f * std::pow(value, 1.0f / 2.4f) - 0.055f;
}

Colour ColourOf(int red, int green, int blue) {
  return {LinearFromSrgb(static_cast<float>(red) / 255.0f),
          LinearFromSrgb(static_cast<float>(green) / 255.0f),
          LinearFromSrgb(static_cast<float>(blue) / 255.0f)};
}

Canvas::Canvas(double width, double height, double metres_per_texel, const Colour& colour)
    : columns_(std::max(1, static_cast<int>(std::lround(width / metres_per_texel)))),
      rows_(std::max(1, static_cast<int>(std::lround(height / metres_per_texel)))),
      metres_per_texel_(metres_per_texel),
      texels_(static_cast<size_t>(columns_) * static_cast<size_t>(rows_), colour) {}

Colour& Canvas::At(int column, int row) {
  return texels_[static_cast<size_t>(Wrapped(row, rows_)) * static_cast<size_t>(columns_) +
                 static_cast<size_t>(Wrapped(column, columns_))];
}

void Canvas::Rectangle(double x, double y, double width, double height, const Colour& colour) {
  ForBox(x, y, width, height, [&](double, double, Colour* texel) { *texel = colour; });
}

void Canvas::Disc(double x, double y, double radius, const Colour& colour) {
  ForBox(x - radius, y - radius, 2 * radius, 2 * radius, [&](double a, double b, Colour* texel) {
    if ((a - x) * (a - x) + (b - y) * (b - y) < radius * radius) *texel = colour;
  });
}

Texture::Texture(Canvas canvas) : metres_per_texel_(canvas.metres_per_texel()) {
  std::vector<Colour> texels;
  texels.reserve(static_cast<size_t>(canvas.columns()) * static_cast<size_t>(canvas.rows()));
  for (int row = 0; row < canvas.rows(); ++row) {
    for (int column = 0; column < canvas.columns(); ++column) {
      texels.push_back(canvas.At(column, row));
    }
  }
  int columns = canvas.columns(), rows = canvas.rows();
  while (true) {
    Level level{columns, rows, {}};
    level.texels.reserve(texels.size());
    for (const Colour& colour : texels) level.texels.push_back(ToBytes(colour));
    levels_.push_back(std::move(level));
    if (columns == 1 && rows == 1) break;
    // The mean of two by two; of an odd number the last stands alone.
    const int half_columns = (columns + 1) / 2, half_rows = (rows + 1) / 2;
    std::vector<Colour> half(static_cast<size_t>(half_columns) * static_cast<size_t>(half_rows));
    for (int row = 0; row < half_rows; ++row) {
      for (int column = 0; column < half_columns; ++column) {
        Colour sum = Colour::Zero();
        for (int k = 0; k < 4; ++k) {
          const int r = std::min(2 * row + k / 2, rows - 1);
          const int c = std::min(2 * column + k % 2, columns - 1);
          sum += texels[static_cast<size_t>(r) * static_cast<size_t>(columns) +
                        static_cast<size_t>(c)];
        }
        half[static_cast<size_t>(row) * static_cast<size_t>(half_columns) +
             static_cast<size_t>(column)] = 0.25f * sum;
      }
    }
    texels = std::move(half);
    columns = half_columns;
    rows = half_rows;
  }
}

Colour Texture::OfLevel(const Level& level, double column, double row) const {
  const double c = std::floor(column), r = std::floor(row);
  const auto s = static_cast<float>(column - c), t = static_cast<float>(row - r);
  const int c0 = Wrapped(static_cast<int>(c), level.columns);
  const int c1 = c0 + 1 == level.columns ? 0 : c0 + 1;
  const int r0 = Wrapped(static_cast<int>(r), level.rows);
  const int r1 = r0 + 1 == level.rows ? 0 : r0 + 1;
  const std::array<float, 256>& linear = LinearOfBytes();
  const auto at = [&](int i, int j) {
    const std::array<uint8_t, 3>& texel =
        level.texels[static_cast<size_t>(j) * static_cast<size_t>(level.columns) +
                     static_cast<size_t>(i)];
    return Colour(linear[texel[0]], linear[texel[1]], linear[texel[2]]);
  };
  return (1 - t) * ((1 - s) * at(c0, r0) + s * at(c1, r0)) +
         t * ((1 - s) * at(c0, r1) + s * at(c1, r1));
}

Colour Texture::At(double x, double y, double footprint) const {
  const Level& finest = levels_.front();
  const double u = x / (finest.columns * metres_per_texel_);
  const double v = y / (finest.rows * metres_per_texel_);
  const auto of = [&](size_t i) {
    const Level& level = levels_[i];
    return OfLevel(level, u * level.columns - 0.5, v * level.rows - 0.5);
  };
  const double wanted = std::log2(std::max(footprint / metres_per_texel_, 1.0));
  const size_t last = levels_.size() - 1;
  const auto below = static_cast<size_t>(wanted);
  if (below >= last) return of(last);
  const auto share = static_cast<float>(wanted - static_cast<double>(below));
  const Colour fine = of(below);
  if (share < 0.01f) return fine;
  return (1 - share) * fine + share * of(below + 1);
}

}  // namespace holba
