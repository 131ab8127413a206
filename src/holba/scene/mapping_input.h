// SPDX-License-Identifier: BSD-3-Clause
// What is known of a set of images, beside the scene that a mapper begins with: read only.
#pragma once

#include <set>

#include "holba/scene/correspondence_graph.h"
#include "holba/scene/image_features.h"

namespace holba {

// All by the ids of the scene's images and cameras.
struct MappingInput {
  CorrespondenceGraph graph;
  ImageFeatureMap features;                          // may be empty
  // Pairs whose keypoints were compared, matched or not: only of these a lack of matches means
  // something.
  std::set<ImagePair> compared_pairs;
  std::set<camera_t> cameras_of_known_focal_length;  // by EXIF or calibration
};

}  // namespace holba
