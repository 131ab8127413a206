// SPDX-License-Identifier: BSD-3-Clause
// What hangs on walls and stands on shelves.
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "holba/base/random.h"
#include "holba/render/texture_recipes.h"

namespace holba {
namespace {

// A colour of print and paint: mostly muted, more often warm or blue than green or violet.
Colour Any(Random* random, double low, double high) {
  constexpr std::array<std::array<double, 3>, 8> kHues = {{{1.0, 0.25, 0.15},
                                                           {1.0, 0.55, 0.2},
                                                           {1.0, 0.85, 0.55},
                                                           {0.2, 0.35, 0.9},
                                                           {0.15, 0.5, 0.75},
                                                           {0.35, 0.6, 0.3},
                                                           {0.9, 0.85, 0.75},
                                                           {0.6, 0.3, 0.35}}};
  const std::array<double, 3>& hue = kHues[random->Index(kHues.size())];
  const double light = random->Uniform(low, high), strength = random->Uniform() * random->Uniform();
  Colour colour;
  for (int i = 0; i < 3; ++i) {
    colour[i] =
        static_cast<float>(light * (1.0 + strength * (1.6 * hue[static_cast<size_t>(i)] - 1.0)));
  }
  return colour.cwiseMax(0.01f).cwiseMin(0.92f);
}

// Lines of writing: runs of strokes as wide as letters.
void Write(double x, double y, double width, double height, double line, const Colour& ink,
           Random* random, Canvas* canvas) {
  for (double top = y; top + line < y + height; top += 1.7 * line) {
    double at = x;
    const double end = x + width * (random->Uniform() < 0.2 ? random->Uniform(0.3, 1.0) : 1.0);
    while (at < end) {
      const double word = line * random->Uniform(1.2, 5.0);
      for (double letter = at; letter < std::min(at + word, end); letter += 0.62 * line) {
        const double rise = random->Uniform(0.0, 0.35) * line;
        canvas->Rectangle(letter, top + rise, 0.16 * line, line - rise, ink);
        if (random->Uniform() < 0.6) {
          canvas->Rectangle(letter, top + random->Uniform(0.2, 0.8) * line, 0.5 * line, 0.17 * line,
                            ink);
        }
      }
      at += word + 0.6 * line;
    }
  }
}

// A landscape of hills under a sky with houses and trees, or rectangles and discs of an abstract
// painter.
void Painting(double x, double y, double width, double height, Random* random, Canvas* canvas) {
  const bool is_landscape = random->Uniform() < 0.55;
  const SmoothNoise noise(canvas->width(), canvas->height(), 9, 9, 6, random->Bits());
  const Colour top = Any(random, 0.15, 0.8), bottom = Any(random, 0.2, 0.9);
  canvas->ForBox(x, y, width, height, [&](double a, double b, Colour* texel) {
    const auto s =
        static_cast<float>(std::clamp((b - y) / height + 0.25 * noise.At(a, b), 0.0, 1.0));
    *texel = (1 - s) * top + s * bottom;
  });
  if (is_landscape) {
    for (int layer = 0; layer < 5; ++layer) {
      const SmoothNoise ridge(canvas->width(), 1.0, 4 + layer, 1, 6, random->Bits());
      const SmoothNoise leaves(canvas->width(), canvas->height(), 60, 60, 4, random->Bits());
      const double level = y + height * (0.35 + 0.14 * layer);
      const Colour colour = Any(random, 0.03, 0.5);
      canvas->ForBox(x, y, width, height, [&](double a, double b, Colour* texel) {
        if (b > level + 0.12 * height * ridge.At(a, 0.0)) {
          *texel = (colour * (1.0f + 0.55f * leaves.At(a, b))).cwiseMax(0.0f).cwiseMin(0.95f);
        }
      });
    }
  }
  const int num = is_landscape ? 14 : 46;
  for (int i = 0; i < num; ++i) {
    const double w = width * random->Uniform(0.02, is_landscape ? 0.10 : 0.3);
    const double h = height * random->Uniform(0.02, is_landscape ? 0.14 : 0.3);
    const double a = x + random->Uniform() * (width - w);
    const double b = is_landscape ? y + height * random->Uniform(0.45, 0.85)
                                  : y + random->Uniform() * (height - h);
    const Colour colour = Any(random, 0.02, 0.9);
    if (random->Uniform() < 0.4) {
      canvas->Disc(a + w / 2, std::min(b + h / 2, y + height - std::min(w, h) / 2),
                   std::min(w, h) / 2, colour);
    } else {
      canvas->Rectangle(a, b, w, std::min(h, y + height - b), colour);
    }
  }
  const SmoothNoise strokes(canvas->width(), canvas->height(), 40, 130, 3, random->Bits());
  canvas->ForBox(x, y, width, height, [&](double a, double b, Colour* texel) {
    *texel = (*texel * (1.0f + 0.15f * strokes.At(a, b))).cwiseMax(0.0f).cwiseMin(0.95f);
  });
}

}  // namespace

Texture PictureTexture(double width, double height, uint64_t seed) {
  Random random(seed);
  const Colour frames[] = {ColourOf(60, 38, 22), ColourOf(24, 24, 26), ColourOf(150, 118, 62),
                           ColourOf(225, 222, 214)};
  Canvas canvas(width, height, 0.0025, frames[random.Index(4)]);
  const double frame = random.Uniform(0.015, 0.035);
  const double mount = frame + (random.Uniform() < 0.6 ? random.Uniform(0.03, 0.07) : 0.004);
  canvas.Rectangle(frame, frame, width - 2 * frame, height - 2 * frame, ColourOf(238, 235, 226));
  Painting(mount, mount, width - 2 * mount, height - 2 * mount, &random, &canvas);
  return Texture(std::move(canvas));
}

Texture PosterTexture(double width, double height, uint64_t seed) {
  Random random(seed);
  const bool is_light = random.Uniform() < 0.6;
  Canvas canvas(width, height, 0.0025,
                is_light ? Any(&random, 0.7, 0.92) : Any(&random, 0.02, 0.3));
  const Colour ink = is_light ? Any(&random, 0.01, 0.12) : Any(&random, 0.75, 0.95);
  const double rim = 0.06 * width;
  Write(rim, rim, width - 2 * rim, 0.2 * height, 0.075 * height, ink, &random, &canvas);
  const double split = random.Uniform(0.45, 0.6);
  Painting(rim, 0.24 * height, width - 2 * rim, (split - 0.24) * height, &random, &canvas);
  const double column = (width - 3 * rim) / 2;
  Write(rim, (split + 0.04) * height, column, (0.92 - split) * height, 0.022 * height, ink, &random,
        &canvas);
  Write(2 * rim + column, (split + 0.04) * height, column, (0.92 - split) * height, 0.022 * height,
        ink, &random, &canvas);
  return Texture(std::move(canvas));
}

Texture BooksTexture(double width, double height, uint64_t seed) {
  Random random(seed);
  Canvas canvas(width, height, 0.002, ColourOf(20, 16, 14));
  double x = 0.0;
  while (x < width - 0.012) {
    const double thickness = std::min(random.Uniform(0.015, 0.05), width - x);
    const Colour colour = Any(&random, 0.02, 0.55);
    canvas.Rectangle(x, 0.0, thickness - 0.0015, height, colour);
    const Colour print = random.Uniform() < 0.5 ? Any(&random, 0.6, 0.9) : Any(&random, 0.02, 0.3);
    const int num_bands = static_cast<int>(random.Index(4));
    for (int i = 0; i < num_bands; ++i) {
      canvas.Rectangle(x, random.Uniform(0.03, 0.95) * height, thickness - 0.0015,
                       random.Uniform(0.002, 0.02), print);
    }
    for (double y = 0.2 * height; y < random.Uniform(0.4, 0.85) * height;
         y += random.Uniform(0.006, 0.012)) {
      canvas.Rectangle(x + 0.25 * thickness, y, random.Uniform(0.2, 0.5) * thickness, 0.004, print);
    }
    x += thickness;
  }
  const SmoothNoise wear(width, height, 20, 8, 5, random.Bits());
  canvas.ForAll([&](double a, double b, Colour* texel) { *texel *= 1.0f + 0.2f * wear.At(a, b); });
  return Texture(std::move(canvas));
}

Texture LabelTexture(double width, double height, uint64_t seed) {
  Random random(seed);
  Canvas canvas(width, height, 0.001, Any(&random, 0.05, 0.8));
  Painting(0.0, 0.12 * height, width, 0.76 * height, &random, &canvas);
  for (int i = 0; i < 3; ++i) {
    const double x = width * (i / 3.0 + random.Uniform(0.0, 0.05));
    const double w = 0.24 * width, y = random.Uniform(0.2, 0.4) * height,
                 h = random.Uniform(0.3, 0.45) * height;
    canvas.Rectangle(x, y, w, h, Any(&random, 0.6, 0.92));
    Write(x + 0.1 * w, y + 0.1 * h, 0.8 * w, 0.8 * h, random.Uniform(0.1, 0.25) * h,
          Any(&random, 0.01, 0.3), &random, &canvas);
  }
  canvas.Rectangle(0.0, 0.1 * height, width, 0.02 * height, Any(&random, 0.02, 0.9));
  canvas.Rectangle(0.0, 0.88 * height, width, 0.02 * height, Any(&random, 0.02, 0.9));
  return Texture(std::move(canvas));
}

}  // namespace holba
