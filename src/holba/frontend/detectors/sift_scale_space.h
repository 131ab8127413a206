// SPDX-License-Identifier: BSD-3-Clause
// Where SIFT features are, and what they look like: extrema of the differences of Gaussians over
// place and scale, the orientations of the gradients around them, descriptors (Lowe, Distinctive
// image features from scale-invariant keypoints, 2004). An extremum is taken as VLFeat and so
// COLMAP take it: it moves from pixel to pixel, not between levels.
#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "holba/frontend/detectors/sift_descriptor.h"

namespace holba {

struct ScaleSpaceOptions {
  int first_octave = -1;  // -1: of the image at twice its size
  int num_octaves = 4;
  int octave_resolution = 3;
  double peak_threshold = 0.02 / 3;  // of brightness 0 to 1
  double edge_threshold = 10.0;
  int max_num_orientations = 2;
  bool upright = false;      // one orientation for all:
  double upright_rad = 0.0;  // the angle of its x axis
};

// Blur of the first level of each octave, in pixels of the octave.
inline constexpr double kScaleSpaceSigma = 1.6;

struct ScaleSpacePoint {
  int octave = 0, level = 0;  // level: 1 to octave_resolution
  double x = 0.0, y = 0.0;    // pixels, centre of the first one at 0
  double sigma_px = 0.0;
  double angle_rad = 0.0;  // from x towards y
  bool is_first = true;    // of those at its place, which follow each other
  SiftDescriptor descriptor = {};
};

// Finest level first, each row by row. `image`: 8 bits, grey.
std::vector<ScaleSpacePoint> FindScaleSpacePoints(const ScaleSpaceOptions& options,
                                                  const cv::Mat& image);

}  // namespace holba
