// SPDX-License-Identifier: BSD-3-Clause
// A finished model, ours or another program's, as the beginning of a mapping run on a database that
// has its images and others.
#pragma once

#include <cstddef>
#include <filesystem>

#include "holba/scene/reconstruction.h"

namespace holba {

struct ContinueReport {
  size_t num_images = 0, num_points = 0, num_observations = 0;
  // Observations whose 2D points are no keypoints of the database, and points that fewer than two
  // observations are left of.
  size_t num_foreign_observations = 0, num_points_left_out = 0;
  size_t num_lines_and_groups_left_out = 0;  // structure is built anew
};

// Gives images of the scene (of the database, without poses) the poses, cameras and points that the
// model has for them. Images are paired by name, 2D points by index where the places agree, else by
// place. Points keep their ids, colours and places. Throws InputError naming `model_path` if an
// image of the model is not in the scene or has another size there, or if none of its 2D points are
// keypoints there.
ContinueReport ContinueModel(const Reconstruction& model, const std::filesystem::path& model_path,
                             Reconstruction* scene);

}  // namespace holba
