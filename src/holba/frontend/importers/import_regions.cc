// SPDX-License-Identifier: BSD-3-Clause
#include "holba/frontend/importers/import_regions.h"

#include <fmt/format.h>

#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include "holba/base/error.h"
#include "holba/base/file_faults.h"
#include "holba/base/log.h"
#include "holba/base/threads.h"
#include "holba/frontend/importers/import_dense_maps.h"
#include "holba/frontend/importers/import_label_maps.h"
#include "holba/frontend/importers/import_store.h"
#include "holba/scene/name_pairing.h"

namespace holba {
namespace fs = std::filesystem;
namespace {

void CheckFolder(const fs::path& folder) {
  if (!folder.empty() && !fs::is_directory(folder)) {
    throw NoSuchFolder(folder);
  }
}

struct ImageRegions {
  std::optional<LabelMap> map;
  std::map<uint16_t, RegionNormal> normals;
  std::map<std::string, size_t> dropped;
};

// By which name a folder has the maps of an image: the image's own, or, where the folder has none
// of this name, that of a map which fits no other image (scene/name_pairing.h).
class MapNames {
 public:
  MapNames(const fs::path& folder, const char* what, const Reconstruction& model) {
    if (folder.empty()) return;
    const std::map<std::string, fs::path> files = FilesBelow(folder);
    const auto has = [&](std::string_view stem) {
      const auto it = files.lower_bound(std::string(stem) + ".");
      return it != files.end() && it->first.starts_with(std::string(stem) + ".");
    };
    std::set<std::string> stems;
    for (const auto& [name, file] : files) {
      if (file.extension() == ".json") continue;
      std::string_view stem = WithoutExtension(name);
      for (const std::string_view kind : {".geometric", ".photometric"}) {
        if (stem.ends_with(kind)) stem.remove_suffix(kind.size());
      }
      stems.emplace(stem);
    }
    std::vector<std::string_view> names;
    size_t num_whole = 0;
    for (const auto& [image_id, image] : model.images) {
      bool is_there = false;
      for (const std::string_view name :
           {std::string_view(image.name), WithoutExtension(image.name)}) {
        is_there = is_there || has(name);
        stems.erase(std::string(name));
      }
      num_whole += is_there;
      if (!is_there) names.push_back(image.name);
    }
    const std::vector<std::string_view> others(stems.begin(), stems.end());
    const NamePairing pairing = PairNames(names, others);
    for (size_t i = 0; i < names.size(); ++i) {
      if (pairing.b_of_a[i]) name_of_map_.emplace(names[i], others[*pairing.b_of_a[i]]);
    }
    if (pairing.num_by_ending > 0)
      LogInfo("{}", HowPaired(what, num_whole, pairing.num_by_ending, pairing.examples));
  }

  const std::string& Of(const Image& image) const {
    const auto found = name_of_map_.find(image.name);
    return found == name_of_map_.end() ? image.name : found->second;
  }

 private:
  std::map<std::string, std::string> name_of_map_;
};

struct NamesOfMaps {
  MapNames labels, normals, depths;
};

ImageRegions ReadRegions(const RegionImportPaths& paths, const NamesOfMaps& names,
                         const Image& image, const Camera& camera,
                         const RegionNormalOptions& options) {
  ImageRegions result;
  result.map = ReadLabelMap(paths.labels, names.labels.Of(image));
  if (!result.map) return result;
  // A map of another shape is not of this image: turned, cropped, or of another camera.
  const auto check_shape = [&](const fs::path& folder, int width, int height) {
    const double ratio = static_cast<double>(width) / height *
                         (static_cast<double>(camera.height) / static_cast<double>(camera.width));
    // One pixel of rounding when the map was made.
    const double tolerance = 1.0 / width + 1.0 / height + 0.01;
    if (!(std::abs(ratio - 1.0) <= tolerance)) {
      throw InputError(folder,
                       fmt::format("the map of '{}' is {} x {} pixels, the image {} x {}; it must "
                                   "cover the same view, neither cropped nor turned",
                                   image.name, width, height, camera.width, camera.height));
    }
  };
  check_shape(paths.labels, result.map->width, result.map->height);
  if (!paths.normals.empty()) {
    if (const auto normals = FindNormalMap(paths.normals, names.normals.Of(image))) {
      check_shape(paths.normals, normals->width, normals->height);
      result.normals = NormalsOfRegions(*result.map, *normals, camera, options, &result.dropped);
      return result;
    }
  }
  if (!paths.depths.empty()) {
    if (const auto depths = FindDepthMap(paths.depths, names.depths.Of(image))) {
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
  const NamesOfMaps names{{paths.labels, "label map", model},
                          {paths.normals, "normal map", model},
                          {paths.depths, "depth map", model}};
  std::vector<image_t> ids;
  for (const auto& [image_id, image] : model.images) ids.push_back(image_id);
  std::vector<ImageRegions> all(ids.size());
  ParallelTasks(num_threads, ids.size(), [&](size_t i) {
    const Image& image = model.images.at(ids[i]);
    all[i] = ReadRegions(paths, names, image, model.cameras.at(image.camera_id), options);
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
    throw InputError(paths.labels, fmt::format("expected label maps named as the images of the "
                                               "model, for example '{}.png', found none",
                                               model.images.begin()->second.name));
  }
}

}  // namespace holba
