// SPDX-License-Identifier: BSD-3-Clause
// Light of a place. What lamps, windows and the sun give is sampled anew for each pixel, with soft
// shadows; what surfaces pass on to each other, and what the sky gives, is smooth and is computed
// once for texels of all surfaces
// ("baked"), by gathering over several bounces.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "holba/render/place.h"
#include "holba/render/ray_caster.h"

namespace holba {

// A sequence of points in the unit square that fill it evenly (Roberts 2018), from a start of its
// own.
class EvenSequence {
 public:
  explicit EvenSequence(uint64_t seed);
  Eigen::Vector2d Next();

 private:
  double x_, y_;
};

class PlaceLight {
 public:
  // The place and the caster must outlive it. `progress(num_done, total)` is called between steps.
  PlaceLight(const Place& place, const RayCaster& caster, uint64_t seed, int num_threads,
             const std::function<void(size_t, size_t)>& progress);

  // Of a matt white surface at the point: radiance that comes from lamps and windows, by so many
  // shadow rays, and from the sun, by one.
  Colour OfLamps(const Eigen::Vector3d& point, const Eigen::Vector3d& normal, int num_samples,
                 EvenSequence* sequence) const;
  Colour OfSun(const Eigen::Vector3d& point, const Eigen::Vector3d& normal,
               EvenSequence* sequence) const;
  // Of the same, what other surfaces and the sky give: from the texels.
  Colour Indirect(int surface, const Eigen::Vector3d& point) const;
  // Radiance of a surface, coarsely, as it is mirrored or passed on; without the emission of lamps
  // that OfLamps samples if `without_lamps`.
  Colour Coarse(const RayCaster::Hit& hit, bool without_lamps) const;

 private:
  struct Lamp {  // a rectangle that shines to the side of its normal
    int surface;
    double area;
    float power;
  };
  struct Chart {  // texels of one surface
    size_t begin = 0;
    int columns = 1, rows = 1;
    bool closes = false;
    Eigen::Vector2d size = Eigen::Vector2d::Ones();
  };
  Colour At(const std::vector<Colour>& texels, int surface, const Eigen::Vector3d& point) const;
  void MakeCharts();
  void FindHidden(int num_threads);
  void Bake(uint64_t seed, int num_threads, const std::function<void(size_t, size_t)>& progress);
  Colour Gather(const Eigen::Vector3d& point, const Eigen::Vector3d& normal, int num_rays,
                EvenSequence* sequence) const;
  void FillHidden(std::vector<Colour>* texels) const;
  void Smooth(std::vector<Colour>* texels) const;
  bool IsLamp(const Surface& surface) const;

  const Place& place_;
  const RayCaster& caster_;
  std::vector<Lamp> lamps_;
  std::vector<Chart> charts_;
  struct Texel {
    int surface;
    Eigen::Vector3d point, normal;
  };
  std::vector<Texel> texels_;
  std::vector<uint8_t> is_hidden_;  // inside of something: without light of its own
  std::vector<Colour> direct_, indirect_;
  std::vector<Colour> mean_colours_;  // of materials
};

}  // namespace holba
