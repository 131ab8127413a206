// SPDX-License-Identifier: BSD-3-Clause
// Gives an image its pose in the model from what it sees of it.
#pragma once

#include <cstddef>
#include <string>

#include "holba/sfm/mapper_options.h"
#include "holba/sfm/mapper_state.h"

namespace holba {

struct RegistrationReport {
  bool accepted = false;
  size_t num_points = 0, num_lines = 0;                // matches with the model
  size_t num_point_inliers = 0, num_line_inliers = 0;  // those that agree with the pose
  std::string failure;                                 // a phrase; empty: none
};

// From matches with 3D points and lines. The frame of the image is registered with all of its
// images, and the inliers become observations. A camera whose focal length is not known gets it
// here with its first image.
RegistrationReport RegisterImage(const MapperOptions& options, image_t image_id,
                                 MapperState* state);

// From matches with images of the model, with or without 3D points: each match with another image
// gives the pose a plane that the ray lies in, and two images or more a scale.
RegistrationReport RegisterWithoutStructure(const MapperOptions& options, image_t image_id,
                                            MapperState* state);

}  // namespace holba
