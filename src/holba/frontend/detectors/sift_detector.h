// SPDX-License-Identifier: BSD-3-Clause
// SIFT (Lowe, Distinctive image features from scale-invariant keypoints, 2004) with COLMAP's
// options, limits and conventions: key points with the centre of the first pixel at 0.5, RootSIFT
// (Arandjelovic and Zisserman, 2012) in bytes, in the order of Lowe's descriptor. Not OpenCV's
// SIFT, which (4.6) has its key points a quarter of a pixel too far right and down, gives up a
// tenth of them, and rounds descriptors before their roots are taken.
#pragma once

#include <Eigen/Core>

#include "holba/base/options.h"
#include "holba/frontend/photographs/photograph.h"
#include "holba/scene/keypoints.h"

namespace holba {

enum class DescriptorNormalisation { kL1Root, kL2 };

// Names and defaults are COLMAP's.
struct SiftOptions {
  int max_image_size = 3200;    // larger photographs are scaled down to this width or height
  int max_num_features = 8192;  // see DetectSift
  int first_octave = -1;        // -1: of the image at twice its size
  int num_octaves = 4;
  int octave_resolution = 3;
  double peak_threshold = 0.02 / 3;  // of the difference of Gaussians of brightness 0 to 1
  double edge_threshold = 10.0;      // ratio of the principal curvatures
  int max_num_orientations = 2;
  bool upright = false;
  DescriptorNormalisation normalisation = DescriptorNormalisation::kL1Root;

  void Describe(OptionTable* table) const;
};

struct SiftFeatures {
  Keypoints keypoints;  // 6 columns; finest level first
  Descriptors descriptors;
};

// Same image and options: same features; may be called from several threads. As in COLMAP the
// levels of the scale space are kept as a whole, from the coarsest on, until there are more than
// max_num_features places: what one level holds may be too many. `upright_deg`: with
// options.upright the direction of the descriptors' x axis in the image (from x towards y).
// `mask`: of the image's size, no key point is where it is 0; null: anywhere.
SiftFeatures DetectSift(const SiftOptions& options, const GreyImage& image,
                        const GreyImage* mask = nullptr, double upright_deg = 0.0);

// For tests: images of more pixels than this have their octave -1 searched in strips, which
// bounds the memory (about 160 bytes a pixel of a strip, 50 of the image).
inline constexpr int kMaxSiftPartPixels = 2'500'000;
SiftFeatures DetectSiftInParts(const SiftOptions& options, const GreyImage& image,
                               int max_part_pixels);

}  // namespace holba
