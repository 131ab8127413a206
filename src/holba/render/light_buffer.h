// SPDX-License-Identifier: BSD-3-Clause
// The light of one photograph before it is developed. Few shadow rays for each pixel give the light
// of lamps with noise that no camera has; it is taken out where neighbours are of one surface,
// whose texture is no part of it (an edge-avoiding wavelet: Dammertz et al. 2010).
#pragma once

#include <span>
#include <vector>

#include "holba/render/texture.h"

namespace holba {

struct LightSample {
  int surface = -1;                  // -1: none
  Colour albedo = Colour::Zero();    // share of `lamps` that comes back
  Colour lamps = Colour::Zero();     // of lamps and windows, as from a matt white surface
  Colour mirrored = Colour::Zero();  // by the polish
  Colour rest = Colour::Zero();      // all other light, as it reaches the camera
  Colour Radiance() const { return albedo.cwiseProduct(lamps) + mirrored + rest; }
};

class LightBuffer {
 public:
  LightBuffer(int width, int height);

  // The samples of a pixel. Pixels of different rows may be put at the same time.
  void Put(int column, int row, std::span<const LightSample> samples);
  // Radiance of each pixel, row by row.
  std::vector<Colour> Resolve(int num_threads) const;

 private:
  struct Pixel {
    int surface = -1;  // of all samples; -1: they differ, or meet nothing
    Colour albedo = Colour::Zero(), lamps = Colour::Zero(), mirrored = Colour::Zero(),
           rest = Colour::Zero();
  };
  void Smooth(int step, float tolerance, int num_threads, std::vector<Pixel>* pixels) const;
  Colour OfMixed(const LightSample& sample, int column, int row,
                 const std::vector<Pixel>& pixels) const;

  int width_, height_;
  std::vector<Pixel> pixels_;
  // Of pixels whose samples differ in their surfaces; rows apart.
  struct MixedPixel {
    int column;
    std::vector<LightSample> samples;
  };
  std::vector<std::vector<MixedPixel>> mixed_;
};

}  // namespace holba
