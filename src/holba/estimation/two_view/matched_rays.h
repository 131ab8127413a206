// SPDX-License-Identifier: BSD-3-Clause
// Matched points of two images as two-view models see them: the rays of both ends and how these
// change with the pixels, so that errors are in pixels for a camera of any model and field of view.
//
// Of one end, ray r (3) of the pixel x (2) in the frame of its camera:
//   d_ray = dr/dx (3x2), with d_pixel d_ray = I;
//   d_pixel = dx/dr (2x3), with d_pixel r = 0 (only the direction of a ray has a pixel).
// A camera of unknown calibration is a pinhole of an assumed focal length: of rays that are only
// known up to a matrix K, what is said here holds as well, and models of them are models of pixels.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "holba/estimation/two_view/two_view_kernels.h"
#include "holba/scene/keypoints.h"
#include "holba/scene/reconstruction.h"
#include "holba/scene/two_view_geometry.h"

namespace holba {

// A pinhole camera for models of pixels: focal length the longer side, principal point the middle.
Camera AssumedPinhole(uint64_t width, uint64_t height);

class MatchedRays {
 public:
  MatchedRays() = default;
  // pixels1[i] and pixels2[i] belong together. Pairs without a ray at one end are left out:
  // Original says which are there.
  MatchedRays(const Camera& camera1, std::span<const Eigen::Vector2d> pixels1,
              const Camera& camera2, std::span<const Eigen::Vector2d> pixels2);

  size_t size() const { return original_.size(); }
  // Index of a pair among those that were given.
  uint32_t Original(size_t i) const { return original_[i]; }
  Eigen::Vector3d Ray1(size_t i) const { return Ray(0, i); }
  Eigen::Vector3d Ray2(size_t i) const { return Ray(kColumnsOfEnd, i); }

  // The same matches, of which only those with a flag count in gains and fits.
  MatchedRays Counting(std::span<const uint8_t> flags) const;
  // Radians that a pixel is wide, on average over the matches.
  double AnglePerPixel() const { return angle_per_pixel_; }

  MatchColumns Columns() const { return {values_.data(), stride_, stride_}; }

 private:
  Eigen::Vector3d Ray(size_t column, size_t i) const {
    const double* v = values_.data() + column * stride_ + i;
    return {v[0], v[stride_], v[2 * stride_]};
  }
  void SetEnd(size_t column, size_t i, const Eigen::Vector3d& ray,
              const Eigen::Matrix<double, 3, 2>& d_ray, const Eigen::Matrix<double, 2, 3>& d_pixel);

  std::vector<uint32_t> original_;
  double angle_per_pixel_ = 0.0;
  size_t stride_ = 0;           // size() up to whole packs
  std::vector<double> values_;  // column by column
};

}  // namespace holba
