// SPDX-License-Identifier: BSD-3-Clause
#include "holba/frontend/importers/import_regions.h"

#include <fmt/format.h>

#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include "holba/base/error.h"
#include "holba/base/threads.h"
#include "holba/frontend/importers/import_dense_maps.h"
#include "holba/frontend/importers/import_label_maps.h"

namespace holba {
namespace fs = std::filesystem;
namespace {

void CheckFolder(const fs::path& folder) {
  if (!folder.empty() && !fs::is_directory(folder)) {
    throw InputError(folder, "there is no such folder");
  }
}

struct ImageRegions {
  std::optional<LabelMap> map;
  std::map<uint16_t, RegionNormal> normals;
  std::map<std::string, size_t> dropped;
};

ImageRegions ReadRegions(const RegionImportPaths& paths, const Image& image, const Camera& camera,
                         const RegionNormalOptions& options) {
  ImageRegions result;
  result.map = ReadLabelMap(paths.labels, image.name);
  if (!result.map) return result;
  // A map of another shape is not of this image: turned, cropped, or of another camera.
  const auto check_shape = [&](const fs::path& folder, int width, int height) {
    const double ratio = static_cast<double>(width) / height *
                         (static_cast<double>(camera.height) / static_cast<double>(camera.width));
    // One pixel of rounding when the map was made.
    const double tolerance = 1.0 / width + 1.0 / height + 0.01;
    if (!(std::abs(ratio - 1.0) <= tolerance)) {
      throw InputError(folder, fmt::format("the map of '{}' is {} x {} pixels, the image {} x {}: "
                                           "it must cover the same view; do not crop or turn it",
                                           image.name, width, height, camera.width, camera.height));
    }
  };
  check_shape(paths.labels, result.map->width, result.map->height);
  if (!paths.normals.empty()) {
    if (const auto normals = FindNormalMap(paths.normals, image.name)) {
      check_shape(paths.normals, normals->width, normals->height);
      result.normals = NormalsOfRegions(*result.map, *normals, camera, options, &result.dropped);
      return result;
    }
  }
  if (!paths.depths.empty()) {
    if (const auto depths = FindDepthMap(paths.depths, image.name)) {
      check_shape(paths.depths, depths->width, depths->height);
      result.normals = NormalsOfRegions(*result.map, *depths, camera, options, &result.dropped);
    }
  }
  return result;
}

}  // namespace

void ImportRegions(const RegionImportPaths& paths, const Reconstruction& model,
                   const RegionNormalOptions& options, int num_threads, ImageFeatureMap* features,
                   RegionImportReport* report) {
  if (paths.labels.empty()) return;
  for (const fs::path* folder : {&paths.labels, &paths.normals, &paths.depths}) {
    CheckFolder(*folder);
  }
  std::vector<image_t> ids;
  for (const auto& [image_id, image] : model.images) ids.push_back(image_id);
  std::vector<ImageRegions> all(ids.size());
  ParallelTasks(num_threads, ids.size(), [&](size_t i) {
    const Image& image = model.images.at(ids[i]);
    all[i] = ReadRegions(paths, image, model.cameras.at(image.camera_id), options);
  });
  for (size_t i = 0; i < ids.size(); ++i) {
    if (!all[i].map) {
      ++report->num_images_without;
      continue;
    }
    ++report->num_maps;
    report->num_regions += all[i].map->types.size();
    report->num_normals += all[i].normals.size();
    for (const auto& [reason, count] : all[i].dropped) report->dropped[reason] += count;
    ImageFeatures& of_image = (*features)[ids[i]];
    of_image.label_map = std::move(*all[i].map);
    of_image.normals = std::move(all[i].normals);
  }
  if (report->num_maps == 0 && !ids.empty()) {
    throw InputError(paths.labels,
                     fmt::format("there is no label map of any image of the model: expected for "
                                 "example '{}.png'",
                                 model.images.begin()->second.name));
  }
}

}  // namespace holba
