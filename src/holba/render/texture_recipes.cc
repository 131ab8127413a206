// SPDX-License-Identifier: BSD-3-Clause
// Walls, floors and cloth; what hangs on walls and stands on shelves is in texture_pictures.cc.
#include "holba/render/texture_recipes.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "holba/base/random.h"

namespace holba {
namespace {

// Between -1 and 1.
float Hash(int x, int y, uint64_t seed) {
  uint64_t z =
      seed + 0x9e3779b97f4a7c15ULL * (static_cast<uint64_t>(static_cast<uint32_t>(x)) +
                                      (static_cast<uint64_t>(static_cast<uint32_t>(y)) << 32));
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ULL;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebULL;
  z ^= z >> 31;
  return static_cast<float>(z >> 40) * (2.0f / 16777216.0f) - 1.0f;
}

int Wrapped(int i, int size) {
  const int rest = i % size;
  return rest < 0 ? rest + size : rest;
}

Colour Scaled(const Colour& colour, float factor) {
  return (factor * colour).cwiseMax(0.0f).cwiseMin(0.95f);
}

Colour Random3(Random* random, float spread) {
  return {1.0f + static_cast<float>(random->Uniform(-spread, spread)),
          1.0f + static_cast<float>(random->Uniform(-spread, spread)),
          1.0f + static_cast<float>(random->Uniform(-spread, spread))};
}

// Spots of a random change, as grains and stains have them.
void Speckle(double per_square_metre, double min_radius, double max_radius, double contrast,
             Random* random, Canvas* canvas) {
  const auto num = static_cast<int>(per_square_metre * canvas->width() * canvas->height());
  for (int i = 0; i < num; ++i) {
    const double x = random->Uniform(0, canvas->width()), y = random->Uniform(0, canvas->height());
    // Small ones are the many.
    const double share = random->Uniform();
    const double radius = min_radius + (max_radius - min_radius) * share * share * share;
    const auto factor = static_cast<float>(1.0 + random->Uniform(-contrast, contrast));
    const double stretch = random->Uniform(0.6, 1.6), turn = random->Uniform(0, std::numbers::pi);
    const double c = std::cos(turn), s = std::sin(turn), reach = radius * 1.7;
    canvas->ForBox(x - reach, y - reach, 2 * reach, 2 * reach,
                   [&](double a, double b, Colour* texel) {
                     const double u = (c * (a - x) + s * (b - y)) * stretch;
                     const double v = (-s * (a - x) + c * (b - y)) / stretch;
                     if (u * u + v * v < radius * radius) *texel = Scaled(*texel, factor);
                   });
  }
}

// Each texel by 1 + grain * noise of its own.
void Grain(double grain, uint64_t seed, Canvas* canvas) {
  for (int row = 0; row < canvas->rows(); ++row) {
    for (int column = 0; column < canvas->columns(); ++column) {
      Colour& texel = canvas->At(column, row);
      texel = Scaled(texel, 1.0f + static_cast<float>(grain) * Hash(column, row, seed));
    }
  }
}

void Clouds(double amount, const SmoothNoise& noise, Canvas* canvas) {
  canvas->ForAll([&](double x, double y, Colour* texel) {
    *texel = Scaled(*texel, 1.0f + static_cast<float>(amount) * noise.At(x, y));
  });
}

}  // namespace

SmoothNoise::SmoothNoise(double width, double height, int cells_x, int cells_y, int octaves,
                         uint64_t seed)
    : width_(width),
      height_(height),
      cells_x_(cells_x),
      cells_y_(cells_y),
      octaves_(octaves),
      seed_(seed) {}

float SmoothNoise::At(double x, double y) const {
  float sum = 0.0f, amplitude = 1.0f;
  int cells_x = cells_x_, cells_y = cells_y_;
  for (int octave = 0; octave < octaves_; ++octave) {
    const double u = x / width_ * cells_x, v = y / height_ * cells_y;
    const double i = std::floor(u), j = std::floor(v);
    const auto s = static_cast<float>(u - i), t = static_cast<float>(v - j);
    const float a = s * s * (3 - 2 * s), b = t * t * (3 - 2 * t);
    const int i0 = Wrapped(static_cast<int>(i), cells_x), i1 = Wrapped(i0 + 1, cells_x);
    const int j0 = Wrapped(static_cast<int>(j), cells_y), j1 = Wrapped(j0 + 1, cells_y);
    const uint64_t seed = seed_ + static_cast<uint64_t>(octave) * 7919u;
    sum += amplitude * ((1 - b) * ((1 - a) * Hash(i0, j0, seed) + a * Hash(i1, j0, seed)) +
                        b * ((1 - a) * Hash(i0, j1, seed) + a * Hash(i1, j1, seed)));
    amplitude *= 0.5f;
    cells_x *= 2;
    cells_y *= 2;
  }
  return sum;
}

Texture PlainTexture(const Colour& colour) { return Texture(Canvas(1.0, 1.0, 1.0, colour)); }

Texture PlasterTexture(const Colour& colour, double contrast, uint64_t seed) {
  Random random(seed);
  Canvas canvas(4.1, 3.1, 0.004, colour);
  Clouds(0.05 * contrast, SmoothNoise(4.1, 3.1, 4, 3, 5, random.Bits()), &canvas);
  Clouds(0.03 * contrast, SmoothNoise(4.1, 3.1, 120, 90, 3, random.Bits()), &canvas);
  Speckle(40 * contrast, 0.003, 0.02, 0.12 * contrast, &random, &canvas);
  Grain(0.02 * contrast, random.Bits(), &canvas);
  return Texture(std::move(canvas));
}

Texture WoodTexture(const Colour& colour, double board_width, uint64_t seed) {
  Random random(seed);
  const double length = 2.4;
  const int num_boards = board_width > 0.0 ? static_cast<int>(std::lround(1.6 / board_width)) : 1;
  const double width = board_width > 0.0 ? num_boards * board_width : 1.2;
  Canvas canvas(length, width, 0.0025, colour);
  const SmoothNoise grain(length, width, 3, 90, 3, random.Bits());
  const SmoothNoise fibre(length, width, 24, 480, 2, random.Bits());
  const SmoothNoise bend(length, width, 3, 4, 3, random.Bits());
  const double pitch = width / num_boards;
  std::vector<double> joints, shades, shifts;
  for (int i = 0; i < num_boards; ++i) {
    joints.push_back(random.Uniform(0, length));
    shades.push_back(random.Uniform(-0.18, 0.18));
    shades.push_back(random.Uniform(-0.18, 0.18));
    shifts.push_back(random.Uniform(0, length));
  }
  canvas.ForAll([&](double x, double y, Colour* texel) {
    const auto board = static_cast<size_t>(std::min(num_boards - 1, static_cast<int>(y / pitch)));
    const double ring = 0.035 * bend.At(x + shifts[board], y);
    float factor = 1.0f + 0.16f * grain.At(x + shifts[board], y + ring + shifts[board]) +
                   0.06f * fibre.At(x, y);
    if (board_width > 0.0) {
      const double from_joint = std::fmod(x - joints[board] + length, length);
      factor *= static_cast<float>(1.0 + shades[2 * board + (from_joint < 0.5 * length ? 1 : 0)]);
      const double to_side = std::min(y - static_cast<double>(board) * pitch,
                                      static_cast<double>(board + 1) * pitch - y);
      const double half = std::fmod(from_joint, 0.5 * length);
      if (to_side < 0.0016 || half < 0.003) factor *= 0.45f;
    }
    *texel = Scaled(*texel, factor);
  });
  const int num_knots = static_cast<int>(2.0 * length * width);
  for (int i = 0; i < num_knots; ++i) {
    const double x = random.Uniform(0, length), y = random.Uniform(0, width);
    const double radius = random.Uniform(0.006, 0.016);
    canvas.ForBox(x - 3 * radius, y - 2 * radius, 6 * radius, 4 * radius,
                  [&](double a, double b, Colour* texel) {
                    const double r = std::hypot((a - x) / 2.2, b - y) / radius;
                    if (r < 1.0) {
                      *texel = Scaled(*texel, static_cast<float>(0.45 + 0.15 * std::sin(14 * r)));
                    }
                  });
  }
  return Texture(std::move(canvas));
}

Texture TileTexture(const Colour& first, const Colour& second, double tile, bool chessboard,
                    uint64_t seed) {
  Random random(seed);
  const int num = 2 * std::max(1, static_cast<int>(std::lround(1.2 / tile)));
  Canvas canvas(num * tile, num * tile, 0.003, first);
  for (int row = 0; row < num; ++row) {
    for (int column = 0; column < num; ++column) {
      const bool is_second = chessboard ? (row + column) % 2 == 1 : random.Uniform() < 0.3;
      const Colour colour = (is_second ? second : first).cwiseProduct(Random3(&random, 0.02f)) *
                            static_cast<float>(random.Uniform(0.9, 1.08));
      canvas.Rectangle(column * tile, row * tile, tile, tile, colour);
    }
  }
  Clouds(0.10, SmoothNoise(canvas.width(), canvas.height(), 9, 9, 5, random.Bits()), &canvas);
  for (int i = 0; i < num; ++i) {
    const Colour joint = ColourOf(120, 116, 108);
    canvas.Rectangle(i * tile, 0.0, 0.006, canvas.height(), joint);
    canvas.Rectangle(0.0, i * tile, canvas.width(), 0.006, joint);
  }
  Speckle(60, 0.002, 0.02, 0.15, &random, &canvas);
  return Texture(std::move(canvas));
}

Texture BrickTexture(const Colour& brick, const Colour& mortar, double length, double height,
                     uint64_t seed) {
  Random random(seed);
  const double joint = 0.045 * length + 0.003;
  const int columns = std::max(2, static_cast<int>(std::lround(4.0 / length)));
  const int rows = 2 * std::max(1, static_cast<int>(std::lround(1.6 / height)));
  Canvas canvas(columns * length, rows * height, std::clamp(0.02 * length, 0.004, 0.01), mortar);
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      const double x = (column + 0.5 * (row % 2)) * length;
      const Colour colour = brick.cwiseProduct(Random3(&random, 0.06f)) *
                            static_cast<float>(random.Uniform(0.65, 1.2));
      const double wear = 0.25 * joint;
      canvas.Rectangle(x + random.Uniform(0, wear), row * height + random.Uniform(0, wear),
                       length - joint - random.Uniform(0, wear),
                       height - joint - random.Uniform(0, wear), colour);
    }
  }
  Clouds(0.10, SmoothNoise(canvas.width(), canvas.height(), 5, 4, 7, random.Bits()), &canvas);
  Speckle(250, 0.002, 0.03, 0.3, &random, &canvas);
  Grain(0.08, random.Bits(), &canvas);
  return Texture(std::move(canvas));
}

Texture StoneTexture(const Colour& colour, double contrast, uint64_t seed) {
  Random random(seed);
  Canvas canvas(4.0, 4.0, 0.005, colour);
  Clouds(0.16 * contrast, SmoothNoise(4.0, 4.0, 3, 3, 8, random.Bits()), &canvas);
  Speckle(160 * contrast, 0.004, 0.07, 0.25 * contrast, &random, &canvas);
  Grain(0.10 * contrast, random.Bits(), &canvas);
  return Texture(std::move(canvas));
}

Texture ClothTexture(const Colour& first, const Colour& second, uint64_t seed) {
  Random random(seed);
  Canvas canvas(0.8, 0.8, 0.002, first);
  if ((first - second).norm() > 1e-3f) {
    for (double x = 0.0; x < 0.8;) {
      const double width = random.Uniform(0.01, 0.06);
      canvas.Rectangle(x, 0.0, width, 0.8, second);
      x += width + random.Uniform(0.02, 0.1);
    }
  }
  canvas.ForAll([&](double x, double y, Colour* texel) {
    const double weave =
        std::sin(2 * std::numbers::pi * 100 * x) * std::sin(2 * std::numbers::pi * 100 * y);
    *texel = Scaled(*texel, 1.0f + 0.10f * static_cast<float>(weave));
  });
  Clouds(0.08, SmoothNoise(0.8, 0.8, 6, 6, 5, random.Bits()), &canvas);
  return Texture(std::move(canvas));
}

Texture CarpetTexture(double width, double height, uint64_t seed) {
  Random random(seed);
  const Colour palette[] = {ColourOf(128, 38, 34), ColourOf(34, 48, 84), ColourOf(190, 160, 110),
                            ColourOf(60, 78, 58), ColourOf(216, 200, 170)};
  const auto pick = [&]() -> const Colour& { return palette[random.Index(5)]; };
  Canvas canvas(width, height, 0.004, pick());
  double inset = 0.0;
  while (inset < 0.32 * std::min(width, height)) {
    const double band = random.Uniform(0.015, 0.08);
    canvas.Rectangle(inset, inset, width - 2 * inset, height - 2 * inset, pick());
    const Colour figure = pick();
    if (band > 0.035) {
      for (double x = inset + band; x < width - inset - band; x += 1.7 * band) {
        canvas.Disc(x, inset + band / 2, band * 0.3, figure);
        canvas.Disc(x, height - inset - band / 2, band * 0.3, figure);
      }
      for (double y = inset + band; y < height - inset - band; y += 1.7 * band) {
        canvas.Disc(inset + band / 2, y, band * 0.3, figure);
        canvas.Disc(width - inset - band / 2, y, band * 0.3, figure);
      }
    }
    inset += band;
  }
  // Figures inside, by chance as in a hand-made one: none is like another.
  for (int i = 0; i < static_cast<int>(40 * width * height); ++i) {
    const double x = random.Uniform(inset + 0.06, width - inset - 0.06);
    const double y = random.Uniform(inset + 0.06, height - inset - 0.06);
    const double radius = random.Uniform(0.015, 0.06);
    const Colour outer = pick(), inner = pick();
    const int petals = 3 + static_cast<int>(random.Index(5));
    canvas.ForBox(x - radius, y - radius, 2 * radius, 2 * radius,
                  [&](double a, double b, Colour* texel) {
                    const double r = std::hypot(a - x, b - y) / radius;
                    const double rim = 0.75 + 0.25 * std::cos(petals * std::atan2(b - y, a - x));
                    if (r < rim) *texel = r < 0.5 * rim ? inner : outer;
                  });
  }
  Clouds(0.12, SmoothNoise(width, height, 8, 8, 4, random.Bits()), &canvas);
  Grain(0.12, random.Bits(), &canvas);
  return Texture(std::move(canvas));
}

Texture WallpaperTexture(const Colour& ground, const Colour& figure, uint64_t seed) {
  Random random(seed);
  Canvas canvas(3.2, 2.88, 0.004, ground);
  for (int i = 0; i < 10; ++i) {
    canvas.Rectangle(0.32 * i, 0, 0.16, 2.88, 0.5f * (ground + Scaled(ground, 0.8f)));
    for (int j = 0; j < 9; ++j) {
      // Printed with a little play, so that no two are the same to a camera that is near.
      const double x = 0.32 * i + 0.08 + random.Uniform(-0.006, 0.006);
      const double y = 0.32 * j + 0.16 + random.Uniform(-0.006, 0.006);
      for (int petal = 0; petal < 5; ++petal) {
        const double angle = 2 * std::numbers::pi * petal / 5 + random.Uniform(-0.2, 0.2);
        canvas.Disc(x + 0.024 * std::cos(angle), y + 0.024 * std::sin(angle),
                    random.Uniform(0.012, 0.018),
                    Scaled(figure, static_cast<float>(random.Uniform(0.8, 1.15))));
      }
      canvas.Disc(x, y, 0.01, ground);
    }
  }
  Clouds(0.04, SmoothNoise(3.2, 2.88, 4, 4, 6, random.Bits()), &canvas);
  Speckle(60, 0.002, 0.012, 0.15, &random, &canvas);
  return Texture(std::move(canvas));
}

}  // namespace holba
