// SPDX-License-Identifier: BSD-3-Clause
#include "holba/render/light_buffer.h"

#include <algorithm>
#include <cmath>

#include "holba/base/threads.h"

namespace holba {

LightBuffer::LightBuffer(int width, int height)
    : width_(width),
      height_(height),
      pixels_(static_cast<size_t>(width) * static_cast<size_t>(height)),
      mixed_(static_cast<size_t>(height)) {}

void LightBuffer::Put(int column, int row, std::span<const LightSample> samples) {
  Pixel& pixel =
      pixels_[static_cast<size_t>(row) * static_cast<size_t>(width_) + static_cast<size_t>(column)];
  const bool is_mixed = std::any_of(samples.begin(), samples.end(), [&](const LightSample& sample) {
    return sample.surface != samples[0].surface;
  });
  if (is_mixed) {
    mixed_[static_cast<size_t>(row)].push_back({column, {samples.begin(), samples.end()}});
    return;
  }
  pixel.surface = samples[0].surface;
  for (const LightSample& sample : samples) {
    pixel.albedo += sample.albedo;
    pixel.lamps += sample.lamps;
    pixel.mirrored += sample.mirrored;
    pixel.rest += sample.rest;
  }
  const float share = 1.0f / static_cast<float>(samples.size());
  pixel.albedo *= share;
  pixel.lamps *= share;
  pixel.mirrored *= share;
  pixel.rest *= share;
}

void LightBuffer::Smooth(int step, float tolerance, int num_threads,
                         std::vector<Pixel>* pixels) const {
  constexpr float kKernel[] = {1.0f / 16, 4.0f / 16, 6.0f / 16, 4.0f / 16, 1.0f / 16};
  const std::vector<Pixel>& before = *pixels;
  std::vector<Pixel> after = before;
  ParallelTasks(num_threads, static_cast<size_t>(height_), [&](size_t task) {
    const int row = static_cast<int>(task);
    for (int column = 0; column < width_; ++column) {
      const size_t at = task * static_cast<size_t>(width_) + static_cast<size_t>(column);
      const Pixel& here = before[at];
      if (here.surface < 0) continue;
      Colour lamps = Colour::Zero(), mirrored = Colour::Zero();
      float sum = 0.0f;
      const float grey = here.lamps.sum() + 1e-6f;
      for (int dy = -2; dy <= 2; ++dy) {
        const int y = row + dy * step;
        if (y < 0 || y >= height_) continue;
        for (int dx = -2; dx <= 2; ++dx) {
          const int x = column + dx * step;
          if (x < 0 || x >= width_) continue;
          const Pixel& there =
              before[static_cast<size_t>(y) * static_cast<size_t>(width_) + static_cast<size_t>(x)];
          if (there.surface != here.surface) continue;
          float weight = kKernel[dx + 2] * kKernel[dy + 2];
          if (tolerance > 0.0f) {
            // Shadows keep their rims.
            const float other = there.lamps.sum() + 1e-6f;
            const float ratio = (other - grey) / (tolerance * (other + grey));
            weight /= 1.0f + ratio * ratio * ratio * ratio;
          }
          lamps += weight * there.lamps;
          mirrored += weight * there.mirrored;
          sum += weight;
        }
      }
      after[at].lamps = lamps / sum;
      after[at].mirrored = mirrored / sum;
    }
  });
  pixels->swap(after);
}

Colour LightBuffer::OfMixed(const LightSample& sample, int column, int row,
                            const std::vector<Pixel>& pixels) const {
  Colour lamps = Colour::Zero(), mirrored = Colour::Zero();
  float num = 0.0f;
  for (int y = std::max(0, row - 2); y <= std::min(height_ - 1, row + 2); ++y) {
    for (int x = std::max(0, column - 2); x <= std::min(width_ - 1, column + 2); ++x) {
      const Pixel& there =
          pixels[static_cast<size_t>(y) * static_cast<size_t>(width_) + static_cast<size_t>(x)];
      if (sample.surface < 0 || there.surface != sample.surface) continue;
      lamps += there.lamps;
      mirrored += there.mirrored;
      num += 1.0f;
    }
  }
  if (num == 0.0f) return sample.Radiance();
  return sample.albedo.cwiseProduct(lamps / num) + mirrored / num + sample.rest;
}

std::vector<Colour> LightBuffer::Resolve(int num_threads) const {
  std::vector<Pixel> pixels = pixels_;
  Smooth(1, 0.0f, num_threads, &pixels);
  Smooth(2, 0.12f, num_threads, &pixels);
  Smooth(4, 0.06f, num_threads, &pixels);
  std::vector<Colour> image(pixels.size());
  ParallelTasks(num_threads, static_cast<size_t>(height_), [&](size_t row) {
    for (size_t at = row * static_cast<size_t>(width_);
         at < (row + 1) * static_cast<size_t>(width_); ++at) {
      image[at] =
          pixels[at].albedo.cwiseProduct(pixels[at].lamps) + pixels[at].mirrored + pixels[at].rest;
    }
    for (const MixedPixel& mixed : mixed_[row]) {
      Colour sum = Colour::Zero();
      for (const LightSample& sample : mixed.samples)
        sum += OfMixed(sample, mixed.column, static_cast<int>(row), pixels);
      image[row * static_cast<size_t>(width_) + static_cast<size_t>(mixed.column)] =
          sum / static_cast<float>(mixed.samples.size());
    }
  });
  return image;
}

}  // namespace holba
