// SPDX-License-Identifier: BSD-3-Clause
#include "holba/pipeline/detection.h"

#include <fmt/format.h>

#include <algorithm>
#include <vector>

#include "holba/base/error.h"
#include "holba/base/log.h"
#include "holba/base/threads.h"
#include "holba/base/timer.h"
#include "holba/frontend/importers/import_regions.h"
#include "holba/frontend/photographs/photograph.h"
#include "holba/pipeline/settings.h"
#include "holba/scene/ideal_view.h"

namespace holba {
namespace fs = std::filesystem;
namespace {

// Images detected between two writes to the database: what an interruption may lose.
constexpr size_t kImagesPerWrite = 8;

void AddCounts(const std::map<std::string, size_t>& counts, std::map<std::string, size_t>* sum) {
  for (const auto& [reason, count] : counts) (*sum)[reason] += count;
}

uint64_t HashOf(const ImportedSegments& imported) {
  uint64_t hash =
      HashBytes(imported.descriptors.data(), imported.descriptors.size() * sizeof(float));
  for (const LineSegment2d& s : imported.segments) {
    const double values[4] = {s.start.x(), s.start.y(), s.end.x(), s.end.y()};
    hash = HashBytes(values, sizeof(values), hash);
  }
  return hash;
}

struct ImageTask {
  image_t image_id, database_id;
  const Image* image;
  const Camera* camera;
  fs::path path;
  const ImportedSegments* imported = nullptr;
  std::string feature_settings, vp_settings;
  bool has_features = false, has_vps = false;
  ImageFeatures features;
};

void ReadStored(const Database& database, ImageTask* task) {
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

void Detect(const DetectionOptions& options, const Reconstruction& model, ImageTask* task) {
  ImageFeatures& f = task->features;
  if (!task->has_features) {
    const GreyImage photograph = ReadGreyImage(task->path);
    if (static_cast<uint64_t>(photograph.width) != task->camera->width ||
        static_cast<uint64_t>(photograph.height) != task->camera->height) {
      throw InputError(
          task->path,
          fmt::format("the photograph has {} x {} pixels, its camera in the model {} x {}; "
                      "--image_path must be the folder of the photographs that the model "
                      "was made from",
                      photograph.width, photograph.height, task->camera->width,
                      task->camera->height));
    }
    f = ExtractFeatures(options.extraction, photograph, *task->camera,
                        task->imported ? &task->imported->segments : nullptr);
    if (task->imported && !task->imported->descriptors.empty())
      f.segment_descriptors = task->imported->descriptors;
  }
  // A segment without ideal pixels runs to no vanishing point.
  const IdealView view(model, task->image_id);
  std::vector<LineSegment2d> ideal;
  std::vector<size_t> idx_of_ideal;
  for (size_t i = 0; i < f.segments.size(); ++i) {
    if (const auto segment = view.ToIdeal(f.segments[i])) {
      ideal.push_back(*segment);
      idx_of_ideal.push_back(i);
    }
  }
  VanishingPoints found = DetectVanishingPoints(options.vps, ideal, view.K());
  f.vanishing_points = std::move(found.points);
  f.vp_of_segment.assign(f.segments.size(), -1);
  for (size_t i = 0; i < ideal.size(); ++i)
    f.vp_of_segment[idx_of_ideal[i]] = found.vp_of_segment[i];
}

void Store(const ImageTask& task, Database* database) {
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

}  // namespace

void ImportPaths::Describe(OptionTable* table) const {
  table->Section("Import");
  table->Field("segments_path", &segments,
               "Line segments of another detector (text, npz, npy, HDF5), used instead of ours.");
  table->Field("line_matches_path", &line_matches,
               "Matches of those segments (text, npz, HDF5), used instead of ours.");
  table->Field("labels_path", &labels,
               "Folder of label maps (PNG) with a JSON that says what the labels are.");
  table->Field("normals_path", &normals, "Folder of normal maps (npy, npz, PNG, COLMAP's).");
  table->Field("depths_path", &depths, "Folder of depth maps (npy, npz, PNG, COLMAP's).");
  table->Field("correspondences_path", &correspondences,
               "Folder of dense correspondences that carry labelled regions from image to image "
               "(--Regions.matching warp).");
}

void ImportPaths::Check() const {
  const std::pair<const char*, const std::string*> paths[] = {
      {"segments_path", &segments}, {"line_matches_path", &line_matches},
      {"labels_path", &labels},     {"normals_path", &normals},
      {"depths_path", &depths},     {"correspondences_path", &correspondences}};
  for (const auto& [name, path] : paths) {
    if (!path->empty() && !fs::exists(*path)) {
      throw InputError(*path, fmt::format("there is no such file or folder (--Import.{})", name));
    }
  }
  if (!line_matches.empty() && segments.empty()) {
    throw InputError(
        "--Import.line_matches_path needs --Import.segments_path: the indices of a file of matches "
        "count the segments of its detector");
  }
  if (!labels.empty()) return;
  for (const auto& [name, path] : {std::pair("normals_path", &normals),
                                   {"depths_path", &depths},
                                   {"correspondences_path", &correspondences}}) {
    if (!path->empty()) {
      throw InputError(fmt::format(
          "--Import.{} needs --Import.labels_path: it says something about labelled regions",
          name));
    }
  }
}

void DetectionOptions::Describe(OptionTable* table) const {
  imports.Describe(table);
  segment_import.Describe(table);
  region_normals.Describe(table);
  extraction.Describe(table);
  vps.Describe(table);
}

ImageFeatureMap DetectFeatures(const DetectionOptions& options, const PhotographFolder& image_path,
                               const Reconstruction& model,
                               const std::map<image_t, image_t>& database_id, Database* database,
                               std::map<image_t, ImportedSegments>* imported,
                               DetectionReport* report) {
  const Timer timer;
  if (!options.imports.segments.empty()) {
    SegmentImportReport import_report;
    *imported =
        ImportSegments(options.imports.segments, model, options.segment_import, &import_report);
    AddCounts(import_report.dropped, &report->dropped);
    LogInfo(
        "Imported {} segments of {} images; {} images of the model are not in the files, {} names "
        "of the files are not in the model",
        import_report.num_segments, import_report.num_images, import_report.num_images_without,
        import_report.num_unknown_names);
  }

  std::vector<ImageTask> tasks;
  const std::string vp_text = SettingsText("vanishing points 1", options.vps);
  for (const auto& [image_id, image] : model.images) {
    ImageTask task{image_id, database_id.at(image_id), &image, &model.cameras.at(image.camera_id),
                   image_path / image.name};
    task.feature_settings = SettingsOf(options.extraction, *task.camera);
    if (!options.imports.segments.empty()) {
      // An image that the files do not have has no segments.
      task.imported = &(*imported)[image_id];
      task.feature_settings += fmt::format(" imported={:016x}", HashOf(*task.imported));
    }
    tasks.push_back(std::move(task));
  }
  ParallelTasks(options.num_threads, tasks.size(), [&](size_t i) {
    ImageTask& task = tasks[i];
    task.feature_settings += fmt::format(" photograph={:016x}", HashFile(task.path));
    task.vp_settings =
        fmt::format("{} of {} camera={}", vp_text, task.feature_settings, ToString(*task.camera));
  });
  for (ImageTask& task : tasks) ReadStored(*database, &task);

  std::vector<ImageTask*> open;
  for (ImageTask& task : tasks) {
    if (!task.has_vps) open.push_back(&task);
  }
  report->num_images = tasks.size();
  report->images_reused = tasks.size() - open.size();
  for (size_t begin = 0; begin < open.size(); begin += kImagesPerWrite) {
    const size_t count = std::min(kImagesPerWrite, open.size() - begin);
    ParallelTasks(options.num_threads, count,
                  [&](size_t i) { Detect(options, model, open[begin + i]); });
    Database::Transaction transaction(database);
    for (size_t i = 0; i < count; ++i) Store(*open[begin + i], database);
    transaction.Commit();
  }

  ImageFeatureMap features;
  for (ImageTask& task : tasks) {
    ImageFeatures& f = task.features;
    report->num_segments += f.segments.size();
    report->num_corners += f.corners.size();
    report->num_vanishing_points += f.vanishing_points.size();
    features.emplace(task.image_id, std::move(f));
  }
  if (!options.imports.labels.empty()) {
    RegionImportReport regions;
    ImportRegions({options.imports.labels, options.imports.normals, options.imports.depths}, model,
                  options.region_normals, options.num_threads, &features, &regions);
    report->num_labelled_regions = regions.num_regions;
    AddCounts(regions.dropped, &report->dropped);
    LogInfo("Imported label maps of {} images ({} have none): {} regions, {} normals of planes",
            regions.num_maps, regions.num_images_without, regions.num_regions, regions.num_normals);
    const std::string settings = SettingsText("imported", options.region_normals);
    Database::Transaction transaction(database);
    for (const auto& [image_id, f] : features) {
      database->WriteLabelMap(database_id.at(image_id), settings, f.label_map);
      database->WriteNormals(database_id.at(image_id), settings, f.normals);
    }
    transaction.Commit();
  }
  report->detect_seconds = timer.Seconds();
  return features;
}

std::string DetectionText(const DetectionReport& report, const fs::path& database) {
  return fmt::format(
      "{} images: {} segments, {} vanishing points, {} corners ({} images from {}, {} detected), "
      "{:.1f} s",
      report.num_images, report.num_segments, report.num_vanishing_points, report.num_corners,
      report.images_reused, database.string(), report.num_images - report.images_reused,
      report.detect_seconds);
}

}  // namespace holba
