// SPDX-License-Identifier: BSD-3-Clause
// Synthetic adjustment problems of points alone, whose images are tied together like those of large
// reconstructions: a walk along a street, or a photo collection of a landmark. Made for measuring
// solvers: ten thousand images take seconds.
#pragma once

#include <cstdint>
#include <string>

#include "holba/synthetic/bundle_problem.h"

namespace holba {

// kSequence: a camera that looks ahead while it moves along a winding street, a step of 1.2 m from
// image to image; a point on the fronts is followed through 2 to some 25 images in a row, one in
// ten of them missing, 6 in the mean. Without loops: the reduced system is a band.
// kCollection: pictures of a front that is wider the more there are, taken from popular spots at 15
// to 40 m. Images and points are popular to different degrees: track lengths follow a power law
// with exponent -2.5 up to half of the images, as far as the point is seen in them.
enum class PointGraphKind { kSequence, kCollection };

struct PointGraphOptions {
  PointGraphKind kind = PointGraphKind::kSequence;
  uint64_t seed = 0;
  int num_images = 500;
  // Mean over the images; points are added until it is reached.
  double observations_per_image = 600.0;
  std::string camera_model = "SIMPLE_RADIAL";  // by COLMAP's name; f 700, 1000 x 1000 px
  // A camera for each image, with focal lengths that vary by 10 %, instead of one for all.
  bool camera_per_image = false;
  // Standard deviations of Gaussian noise; lengths in metres. That of the start is what a mapper's
  // drift-free model has: more would bend long sequences, which no loop straightens.
  double observation_noise_px = 0.5;  // per coordinate
  double rotation_noise_deg = 0.1;    // per axis, about the camera's centre
  double centre_noise = 0.02;         // per coordinate of the centre
  double point_noise = 0.05;          // per coordinate
  double focal_length_noise = 0.01;   // share of it; of cameras that belong to one image
};

// Throws InputError for an unknown camera model or fewer than 4 images or 20 observations per
// image.
SyntheticProblem MakePointGraph(const PointGraphOptions& options);

}  // namespace holba
