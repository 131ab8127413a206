// SPDX-License-Identifier: BSD-3-Clause
// Key points and descriptors that other programs found, as hloc writes them: HDF5 (or npz, npy)
// with `keypoints` (N, 2) and `descriptors` (D, N) for each image; pixels count from the centre of
// the first one.
#pragma once

#include <cstddef>
#include <filesystem>
#include <map>
#include <optional>

#include "holba/scene/keypoints.h"
#include "holba/scene/reconstruction.h"

namespace holba {

struct ImportedPoints {
  Keypoints keypoints;  // 2 columns, centre of the first pixel at 0.5
  // Single precision, of COLMAP's type "undefined"; as many as key points. Empty: the file has
  // none.
  Descriptors descriptors;
};

struct PointImportReport {
  size_t num_images = 0, num_points = 0;
  size_t num_images_without = 0;  // images of the model that the file does not name
  size_t num_unknown_names = 0;   // names that are no image of the model
};

// The points of the model's images. Throws InputError naming file, place and remedy: wrong shape,
// not finite, outside of the image, no image of the model.
std::map<image_t, ImportedPoints> ImportPoints(const std::filesystem::path& path,
                                               const Reconstruction& model,
                                               PointImportReport* report);

}  // namespace holba
