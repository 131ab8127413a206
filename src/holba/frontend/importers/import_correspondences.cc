// SPDX-License-Identifier: BSD-3-Clause
#include "holba/frontend/importers/import_correspondences.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <string_view>
#include <vector>

#include "holba/base/error.h"
#include "holba/base/file_faults.h"
#include "holba/base/log.h"
#include "holba/frontend/importers/import_names.h"

namespace holba {
namespace fs = std::filesystem;
namespace {

constexpr std::array<std::string_view, 3> kTargetKeys = {"warp", "target", "correspondences"};
constexpr std::string_view kCertaintyKey = "certainty";

bool IsTarget(std::string_view key) {
  return std::find(kTargetKeys.begin(), kTargetKeys.end(), key) != kTargetKeys.end();
}

// A file of arrays; `stem` stands for the pair of arrays that are not named by one.
struct FieldFile {
  fs::path path;
  std::string stem;
  bool is_in_folder;

  // The path of an array with what the file's own path says of it.
  std::string FullName(std::string_view array) const {
    if (!is_in_folder || HasHdf5Extension(path)) return std::string(array);
    return path.extension() == ".npy" ? stem : stem + "/" + std::string(array);
  }
};

std::vector<FieldFile> FieldFiles(const fs::path& path) {
  if (!fs::is_directory(path)) return {{path, path.stem().string(), false}};
  std::vector<FieldFile> files;
  for (const auto& [name, file] : FilesBelow(path)) {
    if (HoldsArrays(file)) files.push_back({file, std::string(WithoutExtension(name)), true});
  }
  return files;
}

// "NAME1/NAME2" of an array. An array may be named by its pair alone.
std::string PairOf(const std::string& full_name, const std::string& stem) {
  const auto [prefix, key] = SplitLast(full_name);
  if (!IsTarget(key)) return full_name;
  return prefix.empty() ? stem : std::string(prefix);
}

// What the names mean is decided on all of them, before the first field is read.
ImageNames NamesOf(const std::vector<FieldFile>& files, const Reconstruction& model) {
  std::vector<std::string> pairs;
  for (const FieldFile& file : files) {
    ReadStoredArrays(file.path, [&](std::string_view array) {
      const std::string full_name = file.FullName(array);
      if (SplitLast(full_name).second != kCertaintyKey)
        pairs.push_back(PairOf(full_name, file.stem));
      return false;
    });
  }
  ImageNames names(model);
  names.LearnFromPairs(pairs, /*is_text=*/false);
  return names;
}

void UseFields(const StoredArrays& stored, const std::string& stem, const ImageNames& names,
               const Reconstruction& model,
               const std::function<void(image_t, image_t, const CorrespondenceField&)>& use,
               CorrespondenceImportReport* report, std::string* unknown) {
  for (const auto& [path, array] : stored) {
    const auto [prefix, key] = SplitLast(path);
    if (key == kCertaintyKey) continue;
    const std::string pair = PairOf(path, stem);
    const auto found = names.FindPair(pair, array.place);
    if (!found) {
      if (report->num_unknown_pairs++ == 0) *unknown = pair;
      continue;
    }
    const auto certainty = IsTarget(key)
                               ? stored.find((prefix.empty() ? "" : std::string(prefix) + "/") +
                                             std::string(kCertaintyKey))
                               : stored.end();
    const Camera& camera2 = model.cameras.at(model.images.at(found->second).camera_id);
    const Eigen::Vector2d size2(static_cast<double>(camera2.width),
                                static_cast<double>(camera2.height));
    use(found->first, found->second,
        FieldFromArray(array, certainty == stored.end() ? nullptr : &certainty->second, size2));
    ++report->num_fields;
  }
}

}  // namespace

CorrespondenceField FieldFromArray(const StoredArray& target, const StoredArray* certainty,
                                   const Eigen::Vector2d& size2) {
  std::vector<uint64_t> shape = target.array.shape;
  if (shape.size() == 4 && shape[0] == 1) shape.erase(shape.begin());
  constexpr uint64_t kMaxSide = 1 << 16;
  if (shape.size() != 3 || (shape[2] != 2 && shape[2] != 4) || shape[0] == 0 || shape[1] == 0 ||
      shape[0] > kMaxSide || shape[1] > kMaxSide) {
    throw InputError(target.place +
                     ": expected correspondences of shape (H, W, 2) [x y in the second image, "
                     "pixels] or (H, W, 4) [RoMa's warp], found " +
                     target.array.ShapeText());
  }
  CorrespondenceField field;
  field.height = static_cast<int>(shape[0]);
  field.width = static_cast<int>(shape[1]);
  field.target_width = size2.x();
  field.target_height = size2.y();
  const std::vector<float> values = target.array.Values<float>();
  const size_t size = static_cast<size_t>(shape[0] * shape[1]);
  field.target.resize(size);
  for (size_t i = 0; i < size; ++i) {
    if (shape[2] == 2) {
      field.target[i] = Eigen::Vector2f(values[2 * i] + 0.5f, values[2 * i + 1] + 0.5f);
      continue;
    }
    const Eigen::Vector2d own((static_cast<double>(i % shape[1]) + 0.5) / field.width * 2.0 - 1.0,
                              (static_cast<double>(i / shape[1]) + 0.5) / field.height * 2.0 - 1.0);
    const Eigen::Vector2d stated(values[4 * i], values[4 * i + 1]);
    // A pixel and a half: some tools have the corners, some the centres of pixels at -1 and 1.
    const Eigen::Vector2d tolerance(3.0 / field.width, 3.0 / field.height);
    if (!(((own - stated).cwiseAbs() - tolerance).maxCoeff() <= 0.0)) {
      throw InputError(fmt::format(
          "{}: pixel ({}, {}) of the warp says it is at ({:.3f}, {:.3f}) of the first image, "
          "expected ({:.3f}, {:.3f}); of RoMa's symmetric warps give the left half, "
          "warp[:, :W // 2], as the pair and the right half with its columns exchanged, "
          "warp[:, W // 2:][..., [2, 3, 0, 1]], as the pair turned round",
          target.place, i % shape[1], i / shape[1], stated.x(), stated.y(), own.x(), own.y()));
    }
    field.target[i] =
        Eigen::Vector2f(static_cast<float>((values[4 * i + 2] + 1.0) / 2.0 * size2.x()),
                        static_cast<float>((values[4 * i + 3] + 1.0) / 2.0 * size2.y()));
  }
  if (certainty != nullptr) {
    if (certainty->array.size() != size) {
      throw InputError(fmt::format("{}: expected the certainty of {} x {} pixels, found {}",
                                   certainty->place, field.width, field.height,
                                   certainty->array.ShapeText()));
    }
    field.certainty = certainty->array.Values<float>();
  }
  return field;
}

void ForEachCorrespondenceField(
    const fs::path& path, const Reconstruction& model,
    const std::function<void(image_t from, image_t to, const CorrespondenceField& field)>& use,
    CorrespondenceImportReport* report) {
  if (!fs::exists(path)) throw NoSuchFileOrFolder(path);
  const std::vector<FieldFile> files = FieldFiles(path);
  const ImageNames names = NamesOf(files, model);
  std::string unknown;
  for (const FieldFile& file : files) {
    StoredArrays stored;
    for (auto& [name, array] : ReadStoredArrays(file.path, [](std::string_view) { return true; }))
      stored[file.FullName(name)] = std::move(array);
    UseFields(stored, file.stem, names, model, use, report, &unknown);
  }
  if (report->num_fields == 0) {
    if (report->num_unknown_pairs > 0)
      throw names.NothingKnown(path, report->num_unknown_pairs, "pair", unknown);
    throw InputError(path,
                     "expected arrays NAME1/NAME2/warp (docs/import.md), found no correspondences");
  }
  if (report->num_unknown_pairs > 0) {
    ImageNames::WarnOfUnknown(path, report->num_unknown_pairs,
                              report->num_unknown_pairs + report->num_fields, "pair", unknown);
  }
}

}  // namespace holba
