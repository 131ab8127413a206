// SPDX-License-Identifier: BSD-3-Clause
#include "holba/pipeline/image_structure.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <utility>
#include <vector>

#include "holba/base/error.h"
#include "holba/pipeline/settings.h"
#include "holba/scene/ideal_view.h"

namespace holba {
namespace fs = std::filesystem;
namespace {

uint64_t HashOf(const ImportedSegments& imported) {
  uint64_t hash =
      HashBytes(imported.descriptors.data(), imported.descriptors.size() * sizeof(float));
  for (const LineSegment2d& s : imported.segments) {
    const double values[4] = {s.start.x(), s.start.y(), s.end.x(), s.end.y()};
    hash = HashBytes(values, sizeof(values), hash);
  }
  return hash;
}

GreyImage ReadOfSize(const fs::path& path, uint64_t width, uint64_t height, const char* what,
                     const char* remedy) {
  GreyImage image = ReadGreyImage(path);
  if (static_cast<uint64_t>(image.width) != width ||
      static_cast<uint64_t>(image.height) != height) {
    throw InputError(path, fmt::format("the {} has {} x {} pixels, its camera {} x {}; {}", what,
                                       image.width, image.height, width, height, remedy));
  }
  return image;
}

}  // namespace

std::string PhotographText(const fs::path& path) {
  return fmt::format(" photograph={:016x}", HashFile(path));
}

fs::path MaskOf(const std::string& mask_path, const std::string& name) {
  const fs::path folder = mask_path;
  const fs::path mask = folder / (name + ".png");
  if (fs::exists(mask)) return mask;
  const fs::path other = folder / fs::path(name).replace_extension(".png");
  if (fs::exists(other)) return other;
  std::string extension = fs::path(name).extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  if (extension == ".png" && fs::exists(folder / name)) return folder / name;
  return mask;
}

GreyImage ReadMask(const fs::path& path, uint64_t width, uint64_t height) {
  if (!fs::exists(path)) {
    throw InputError(path,
                     "there is no such mask; --mask_path must have one for each image NAME, "
                     "NAME.png, white where features are wanted");
  }
  return ReadOfSize(path, width, height, "mask", "it must have the size of its photograph");
}

std::optional<GreyImage> ReadMasks(const StructureTask& task) {
  const uint64_t width = task.camera->width, height = task.camera->height;
  std::optional<GreyImage> mask;
  if (!task.mask.empty()) mask = ReadMask(task.mask, width, height);
  if (task.camera_mask.empty()) return mask;
  const GreyImage of_camera = ReadGreyImage(task.camera_mask);
  if (!mask) {
    mask = GreyImage{static_cast<int>(width), static_cast<int>(height), {}};
    mask->pixels.assign(width * height, 255);
  }
  for (int y = 0; y < mask->height; ++y) {
    for (int x = 0; x < mask->width; ++x) {
      if (!IsUnmasked(of_camera, {x + 0.5, y + 0.5}))
        mask->pixels[static_cast<size_t>(y) * mask->width + x] = 0;
    }
  }
  return mask;
}

GreyImage ReadPhotographOfSize(const fs::path& path, uint64_t width, uint64_t height,
                               const char* remedy) {
  return ReadOfSize(path, width, height, "photograph", remedy);
}

void AddSettings(const ExtractionOptions& extraction, const VanishingPointOptions& vps,
                 StructureTask* task) {
  task->feature_settings = SettingsOf(extraction, *task->camera);
  if (task->imported)
    task->feature_settings += fmt::format(" imported={:016x}", HashOf(*task->imported));
  if (!task->mask.empty())
    task->feature_settings += fmt::format(" mask={:016x}", HashFile(task->mask));
  task->feature_settings += PhotographText(task->path);
  task->vp_settings = fmt::format("{} of {} camera={}", SettingsText("vanishing points 1", vps),
                                  task->feature_settings, ToString(*task->camera));
  if (task->camera_mask.empty()) return;
  const std::string of_camera_mask =
      fmt::format(" camera_mask={:016x}", HashFile(task->camera_mask));
  task->feature_settings += of_camera_mask;
  task->vp_settings += of_camera_mask;
}

void ReadStored(const Database& database, StructureTask* task) {
  ImageFeatures& f = task->features;
  const std::string& settings = task->feature_settings;
  auto segments = database.ReadSegments(task->database_id, settings);
  auto descriptors = database.ReadSegmentDescriptors(task->database_id, settings);
  auto corners = database.ReadCorners(task->database_id, settings);
  if (!segments || !descriptors || !corners) return;
  f.segments = std::move(*segments);
  f.segment_descriptors = std::move(*descriptors);
  f.corners = std::move(corners->positions);
  f.corner_descriptors = std::move(corners->descriptors);
  task->has_features = true;
  if (auto vps = database.ReadVanishingPoints(task->database_id, task->vp_settings)) {
    f.vanishing_points = std::move(vps->points);
    f.vp_of_segment = std::move(vps->vp_of_segment);
    task->has_vps = true;
  }
}

void FindVanishingPoints(const VanishingPointOptions& options, const Camera& camera,
                         ImageFeatures* features) {
  // A segment without ideal pixels runs to no vanishing point.
  Reconstruction alone;
  alone.cameras.Add(1, camera);
  Image image;
  image.camera_id = 1;
  alone.images.Add(1, image);
  const IdealView view(alone, 1);
  std::vector<LineSegment2d> ideal;
  std::vector<size_t> idx_of_ideal;
  for (size_t i = 0; i < features->segments.size(); ++i) {
    if (const auto segment = view.ToIdeal(features->segments[i])) {
      ideal.push_back(*segment);
      idx_of_ideal.push_back(i);
    }
  }
  VanishingPoints found = DetectVanishingPoints(options, ideal, view.K());
  features->vanishing_points = std::move(found.points);
  features->vp_of_segment.assign(features->segments.size(), -1);
  for (size_t i = 0; i < ideal.size(); ++i)
    features->vp_of_segment[idx_of_ideal[i]] = found.vp_of_segment[i];
}

void DetectStructure(const ExtractionOptions& extraction, const VanishingPointOptions& vps,
                     const GreyImage* photograph, const GreyImage* mask, StructureTask* task) {
  ImageFeatures& f = task->features;
  if (!task->has_features) {
    f = ExtractFeatures(extraction, *photograph, *task->camera,
                        task->imported ? &task->imported->segments : nullptr, mask);
    if (task->imported && !task->imported->descriptors.empty())
      f.segment_descriptors = task->imported->descriptors;
  }
  FindVanishingPoints(vps, *task->camera, &f);
}

void StoreStructure(const StructureTask& task, Database* database) {
  Database::Transaction transaction(database);
  const ImageFeatures& f = task.features;
  if (!task.has_features) {
    database->WriteSegments(task.database_id, task.feature_settings, f.segments);
    database->WriteSegmentDescriptors(task.database_id, task.feature_settings,
                                      f.segment_descriptors);
    database->WriteCorners(task.database_id, task.feature_settings,
                           {f.corners, f.corner_descriptors});
  }
  database->WriteVanishingPoints(task.database_id, task.vp_settings,
                                 {f.vanishing_points, f.vp_of_segment});
  transaction.Commit();
}

Camera AsPinholeIfStraight(const Camera& camera) {
  if (camera.model->is_pinhole) return camera;
  constexpr double kSamePx = 1e-6;
  constexpr int kNumSteps = 8;
  for (int row = 0; row <= kNumSteps; ++row) {
    for (int column = 0; column <= kNumSteps; ++column) {
      const Eigen::Vector2d pixel(static_cast<double>(camera.width) * column / kNumSteps,
                                  static_cast<double>(camera.height) * row / kNumSteps);
      const auto ideal = IdealPixel(*camera.model, camera.params.data(), pixel);
      if (!ideal || !((*ideal - pixel).norm() < kSamePx)) return camera;
    }
  }
  const IdealCalibration k = camera.model->ideal_calibration(camera.params.data());
  return {FindCameraModel("PINHOLE"), camera.width, camera.height, {k.fx, k.fy, k.cx, k.cy}};
}

}  // namespace holba
