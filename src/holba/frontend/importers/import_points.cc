// SPDX-License-Identifier: BSD-3-Clause
#include "holba/frontend/importers/import_points.h"

#include <fmt/format.h>

#include <cmath>
#include <cstring>
#include <string>
#include <utility>
#include <vector>

#include "holba/base/error.h"
#include "holba/base/file_faults.h"
#include "holba/frontend/importers/import_names.h"
#include "holba/frontend/importers/import_store.h"

namespace holba {
namespace {

// Detectors run over the rim a little; what is further outside has other units.
constexpr double kMaxOutsidePx = 2.0;
// A descriptor of more values is none.
constexpr uint64_t kMaxDescriptorSize = 1 << 16;

Keypoints ToKeypoints(const StoredArray& stored, const Camera& camera) {
  const NumericArray& array = stored.array;
  if (array.shape.size() != 2 || array.shape[1] != 2) {
    throw InputError(fmt::format("{}: expected key points of shape (N, 2), found {}", stored.place,
                                 array.ShapeText()));
  }
  const std::vector<double> values = array.Values<double>();
  Keypoints keypoints;
  keypoints.data.reserve(values.size());
  for (size_t i = 0; i < values.size(); ++i) {
    const double pixel = values[i] + 0.5;
    const auto extent = static_cast<double>(i % 2 == 0 ? camera.width : camera.height);
    if (!(pixel >= -kMaxOutsidePx && pixel <= extent + kMaxOutsidePx)) {
      throw InputError(fmt::format(
          "{}: key point {} is at {} in {}, outside of the image of {} x {}; they must "
          "be in pixels of the photograph as it is",
          stored.place, i / 2, values[i], i % 2 == 0 ? "x" : "y", camera.width, camera.height));
    }
    keypoints.data.push_back(static_cast<float>(pixel));
  }
  return keypoints;
}

Descriptors ToDescriptors(const StoredArray& stored, size_t num_points) {
  const NumericArray& array = stored.array;
  if (array.shape.size() != 2 || array.shape[1] != num_points ||
      (num_points > 0 && (array.shape[0] < 1 || array.shape[0] > kMaxDescriptorSize))) {
    throw InputError(
        fmt::format("{}: expected descriptors of shape (D, {}), one column for each "
                    "key point, found {}",
                    stored.place, num_points, array.ShapeText()));
  }
  const std::vector<float> values = array.Values<float>();
  const size_t size = num_points > 0 ? array.shape[0] : 1;
  Descriptors descriptors;
  descriptors.type = -1;
  descriptors.num_bytes = static_cast<int>(size * sizeof(float));
  descriptors.data.resize(values.size() * sizeof(float));
  for (size_t i = 0; i < num_points; ++i) {
    for (size_t k = 0; k < size; ++k) {
      const float value = values[k * num_points + i];
      if (!std::isfinite(value)) {
        throw InputError(
            fmt::format("{}: expected finite numbers in the descriptor of key point {}, found {}",
                        stored.place, i, value));
      }
      std::memcpy(descriptors.data.data() + (i * size + k) * sizeof(float), &value, sizeof(float));
    }
  }
  return descriptors;
}

}  // namespace

std::map<image_t, ImportedPoints> ImportPoints(const std::filesystem::path& path,
                                               const Reconstruction& model,
                                               PointImportReport* report) {
  if (!std::filesystem::exists(path)) throw NoSuchFileOrFolder(path, "--Import.points_path");
  if (!HoldsArrays(path)) {
    throw InputError(path,
                     "expected a folder of npz or npy files, or a file that ends in .npz, .h5 or "
                     ".hdf5, with keypoints and descriptors for each image");
  }
  const StoredArrays arrays = ReadStoredArrays(path, [](std::string_view name) {
    const std::string_view last = SplitLast(name).second;
    return last == "keypoints" || last == "descriptors";
  });
  ImageNames names(model);
  std::vector<std::string> names_of_file;
  for (const auto& [key, stored] : arrays) {
    const auto [name, last] = SplitLast(key);
    if (last == "keypoints") names_of_file.emplace_back(name);
  }
  names.Learn(names_of_file);
  std::map<image_t, ImportedPoints> result;
  std::string unknown;
  for (const auto& [key, stored] : arrays) {
    const auto [name, last] = SplitLast(key);
    if (last != "keypoints") continue;
    const std::optional<image_t> image_id = names.Find(name);
    if (!image_id) {
      if (report->num_unknown_names++ == 0) unknown = name;
      continue;
    }
    const Camera& camera = model.cameras.at(model.images.at(*image_id).camera_id);
    ImportedPoints points;
    points.keypoints = ToKeypoints(stored, camera);
    const auto descriptors = arrays.find(std::string(name) + "/descriptors");
    if (descriptors != arrays.end())
      points.descriptors = ToDescriptors(descriptors->second, points.keypoints.size());
    report->num_points += points.keypoints.size();
    if (!result.emplace(*image_id, std::move(points)).second) {
      throw InputError(stored.place + ": '" + std::string(name) +
                       "' is an image that has points already; remove one");
    }
  }
  report->num_images = result.size();
  report->num_images_without = model.images.size() - result.size();
  if (result.empty()) {
    if (unknown.empty()) {
      throw InputError(path,
                       "expected arrays 'keypoints' of images, as hloc writes them, found none");
    }
    throw names.NothingKnown(path, report->num_unknown_names, "image", unknown);
  }
  if (report->num_unknown_names > 0) {
    ImageNames::WarnOfUnknown(path, report->num_unknown_names,
                              report->num_unknown_names + result.size(), "image", unknown);
  }
  return result;
}

}  // namespace holba
