// SPDX-License-Identifier: BSD-3-Clause
// Takes photographs of a place, and the maps that go with them.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "holba/base/options.h"
#include "holba/render/light.h"
#include "holba/render/light_buffer.h"
#include "holba/render/place.h"
#include "holba/render/ray_caster.h"
#include "holba/scene/reconstruction.h"

namespace holba {

struct RenderCameraOptions {
  int width = 640, height = 480;
  std::string model = "PINHOLE";
  std::vector<double> params;  // all of them; empty: from the field of view
  std::vector<double>
      extra_params;  // beyond focal length and principal point; empty: the model's usual
  double field_of_view_deg = 0.0;  // horizontal; 0: the preset's

  void Describe(OptionTable* table) const;  // section "Camera"
};

// The camera that the options state. Throws InputError.
Camera MakeCamera(const RenderCameraOptions& options, double usual_field_of_view_deg);

struct PhotoOptions {
  int samples = 4;               // rays per pixel
  int light_samples = 3;         // shadow rays to lamps and windows, per ray
  double noise = 1.5;            // standard deviation at middle grey, of 255
  double blur_px = 0.5;          // standard deviation of lens and sensor
  double vignetting = 0.15;      // share of light lost in the corners
  double exposure_stops = 0.15;  // largest change of the exposure from image to image, stops

  void Describe(OptionTable* table) const;  // section "Photo"
};

struct Photo {
  int width = 0, height = 0;
  std::vector<uint8_t> rgb;  // row by row
};

// At pixel centres, row by row.
struct TruthMaps {
  int width = 0, height = 0;
  std::vector<double> depth_m;  // z in the camera frame; 0: nothing there
  std::vector<Eigen::Vector3d>
      normals;                // in the camera frame, towards the camera; 0: nothing there
  std::vector<int> entities;  // -1: none
};

// cam_from_world while a row is exposed, of the time from -0.5 (first row) to 0.5.
using PoseOfRow = std::function<Rigid3d(double time)>;

class Photographer {
 public:
  // The arguments must outlive it.
  Photographer(const Place& place, const RayCaster& caster, const PlaceLight& light,
               const Camera& camera, const PhotoOptions& options, int num_threads);

  // So that these views together have their middle grey in the middle.
  void MeasureLight(const std::vector<Rigid3d>& views);
  Photo Take(const PoseOfRow& pose, uint64_t seed) const;
  TruthMaps Maps(const Rigid3d& cam_from_world) const;

 private:
  std::optional<Eigen::Vector3d> RayOf(const Eigen::Vector2d& pixel) const;
  LightSample Sample(const Eigen::Vector3d& from, const Eigen::Vector3d& ray, int num_light_samples,
                     EvenSequence* sequence) const;
  void Blur(std::vector<Colour>* image) const;
  Photo Develop(const std::vector<Colour>& image, double exposure, uint64_t seed) const;

  const Place& place_;
  const RayCaster& caster_;
  const PlaceLight& light_;
  const Camera& camera_;
  PhotoOptions options_;
  int num_threads_;
  int width_, height_;
  double exposure_ = 1.0;
  double pixel_rad_ = 1e-3;  // what a pixel sees, about
  // Rays of the corners of pixels; 0: none.
  std::vector<Eigen::Vector3d> corner_rays_;
};

}  // namespace holba
