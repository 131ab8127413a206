// SPDX-License-Identifier: BSD-3-Clause
// Segmentations with depth or normals beside them, for the images of a model.
#pragma once

#include <filesystem>
#include <map>
#include <string>

#include "holba/frontend/importers/dense_maps.h"
#include "holba/scene/image_features.h"
#include "holba/scene/reconstruction.h"

namespace holba {

struct RegionImportPaths {
  std::filesystem::path labels;   // folder of PNG and JSON; empty: nothing is imported
  std::filesystem::path normals;  // folder of normal maps; empty: none
  std::filesystem::path depths;   // folder of depth maps, for images without normals; empty: none
};

struct RegionImportReport {
  size_t num_maps = 0;
  size_t num_images_without = 0;          // images of the model without a label map
  size_t num_regions = 0;                 // with a type
  size_t num_normals = 0;                 // planes with a normal
  std::map<std::string, size_t> dropped;  // regions of planes without a normal, by reason
};

// Fills label_map and normals of the images' features (added where an image has none). Throws
// InputError, also where no image has a map.
void ImportRegions(const RegionImportPaths& paths, const Reconstruction& model,
                   const RegionNormalOptions& options, int num_threads, ImageFeatureMap* features,
                   RegionImportReport* report);

}  // namespace holba
