// SPDX-License-Identifier: BSD-3-Clause
// The images of a database as a scene without poses: what a mapper begins with.
#pragma once

#include <cstddef>
#include <set>

#include "holba/io/database.h"
#include "holba/scene/reconstruction.h"

namespace holba {

struct DatabaseScene {
  // Cameras, rigs and frames, and all images, unregistered, with their keypoints as points2D and
  // the segments of `features` as lines2D. Ids are the database's.
  Reconstruction scene;
  std::set<camera_t> cameras_of_known_focal_length;
  // Images of rigs of which a sensor's pose is not known: each has a frame of its own.
  size_t num_images_of_unknown_rigs = 0;
};

// Throws InputError for what is damaged.
DatabaseScene ReadScene(const Database& database, const ImageFeatureMap& features = {});

}  // namespace holba
