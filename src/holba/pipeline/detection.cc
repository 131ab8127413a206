// SPDX-License-Identifier: BSD-3-Clause
#include "holba/pipeline/detection.h"

#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <utility>
#include <vector>

#include "holba/base/error.h"
#include "holba/base/log.h"
#include "holba/base/threads.h"
#include "holba/base/timer.h"
#include "holba/frontend/importers/import_regions.h"
#include "holba/frontend/photographs/photograph.h"
#include "holba/pipeline/image_structure.h"
#include "holba/pipeline/settings.h"

namespace holba {
namespace fs = std::filesystem;
namespace {

// Images detected between two writes to the database: what an interruption may lose.
constexpr size_t kImagesPerWrite = 8;

void AddCounts(const std::map<std::string, size_t>& counts, std::map<std::string, size_t>* sum) {
  for (const auto& [reason, count] : counts) (*sum)[reason] += count;
}

struct ImageTask : StructureTask {
  const Image* image = nullptr;
  bool is_cut_off = false;
  std::optional<std::string> fault;  // why its photograph is left out
};

void Detect(const DetectionOptions& options, ImageTask* task) {
  std::optional<GreyImage> photograph, mask;
  if (!task->has_features) {
    const Camera& camera = *task->camera;
    photograph = ReadPhotographOfSize(
        task->path, camera.width, camera.height,
        "--image_path must be the folder of the photographs that the model was made from");
    task->is_cut_off = photograph->ends_early;
    if (!task->mask.empty()) mask = ReadMask(task->mask, camera.width, camera.height);
  }
  DetectStructure(options.extraction, options.vps, photograph ? &*photograph : nullptr,
                  mask ? &*mask : nullptr, task);
}

// Warnings name this many pictures, and count the others.
constexpr size_t kMaxNumNamed = 10;

std::string AndMore(size_t num_all) {
  return num_all > kMaxNumNamed ? fmt::format(" (and {} more)", num_all - kMaxNumNamed) : "";
}

// Says which pictures are left out; throws if that is not wanted, or if none is left.
void HandleLeftOut(bool strict, const DetectionReport& report) {
  if (!report.left_out.empty()) {
    const LeftOutPhotograph& first = report.left_out.front();
    if (strict || report.left_out.size() == report.num_images) {
      throw InputError(report.num_images == 1
                           ? first.reason
                           : fmt::format("{} ({} of {} photographs cannot be used)", first.reason,
                                         report.left_out.size(), report.num_images));
    }
    LogWarning(
        "{} of {} photographs are left out (their points take part, nothing is looked for in them; "
        "--strict 1 stops instead):",
        report.left_out.size(), report.num_images);
    for (size_t i = 0; i < std::min(kMaxNumNamed, report.left_out.size()); ++i)
      LogWarning("  {}", report.left_out[i].reason);
    if (report.left_out.size() > kMaxNumNamed)
      LogWarning("  and {} more", report.left_out.size() - kMaxNumNamed);
  }
  if (!report.cut_off.empty()) {
    std::string names;
    for (size_t i = 0; i < std::min(kMaxNumNamed, report.cut_off.size()); ++i)
      names += (i ? ", " : "") + report.cut_off[i];
    LogWarning(
        "The files of {} photographs end too early, what they lack is taken as grey; copy them "
        "anew: {}{}",
        report.cut_off.size(), names, AndMore(report.cut_off.size()));
  }
}

// Whether the first of the model's points2D are keypoints of the database, as they are for the
// database that the model was made from. Empty: there is nothing to compare.
std::optional<bool> HasKeypointsOf(const Image& image, const Keypoints& keypoints) {
  constexpr size_t kMaxNumCompared = 50;
  constexpr double kSamePx = 1.0;
  if (image.points2D.empty() || keypoints.size() == 0) return std::nullopt;
  // Refined models have points appended to those of the database.
  const size_t num_points = std::min(image.points2D.size(), keypoints.size());
  const size_t count = std::min(num_points, kMaxNumCompared);
  size_t num_found = 0;
  for (size_t k = 0; k < count; ++k) {
    const Eigen::Vector2d& xy = image.points2D[k * num_points / count].xy;
    bool found = false;
    for (size_t i = 0; i < keypoints.size() && !found; ++i)
      found = (keypoints.Position(i) - xy).squaredNorm() < kSamePx * kSamePx;
    num_found += found;
  }
  return 2 * num_found >= count;
}

}  // namespace

void CheckDatabase(const Database& database, const PhotographFolder& image_path,
                   const Reconstruction& model) {
  constexpr size_t kMaxNumChecked = 20;  // evenly spread: the answer is the same for all
  std::map<std::string, image_t> ids_by_name;
  for (const auto& [image_id, image] : database.ReadImages()) ids_by_name[image.name] = image_id;
  if (ids_by_name.empty()) return;
  std::vector<std::pair<const Image*, image_t>> common;
  for (const auto& [image_id, image] : model.images) {
    const auto found = ids_by_name.find(image.name);
    if (found != ids_by_name.end()) common.emplace_back(&image, found->second);
  }
  if (common.empty()) {
    LogWarning("The database {} has {} images, none of this model; the model's images are added",
               database.path().string(), ids_by_name.size());
    return;
  }
  size_t num_compared = 0;
  std::vector<const Image*> others;
  const size_t count = std::min(common.size(), kMaxNumChecked);
  for (size_t k = 0; k < count; ++k) {
    const auto& [image, id] = common[k * common.size() / count];
    const std::optional<Keypoints> keypoints = database.ReadKeypoints(id);
    const std::optional<bool> same = keypoints ? HasKeypointsOf(*image, *keypoints) : std::nullopt;
    if (!same) continue;
    ++num_compared;
    if (*same) continue;
    // The same photographs with other keypoints are those that were looked at before.
    const std::optional<std::string> settings = database.ReadSegmentSettings(id);
    if (settings && settings->find(PhotographText(image_path / image->name)) != std::string::npos)
      continue;
    others.push_back(image);
  }
  if (2 * others.size() <= num_compared) return;
  throw InputError(
      database.path(),
      fmt::format(
          "of {} images with names of the model, {} have other keypoints here (first '{}'): "
          "this is the database of other photographs; give the one that the model was made "
          "from (--database_path), or a file that does not exist yet",
          num_compared, others.size(), others.front()->name));
}

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

void DetectionOptions::Check() const {
  if (!mask_path.empty() && !fs::is_directory(mask_path))
    throw InputError(mask_path, "there is no such folder (--mask_path)");
  imports.Check();
}

void DetectionOptions::Describe(OptionTable* table) const {
  table->Field("mask_path", &mask_path,
               "Folder of masks, as COLMAP's --ImageReader.mask_path: no features where the image "
               "NAME.png is 0 (segments of other programs are taken as they are).");
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
  for (const auto& [image_id, image] : model.images) {
    ImageTask task;
    task.image_id = image_id;
    task.database_id = database_id.at(image_id);
    task.name = image.name;
    task.image = &image;
    task.camera = &model.cameras.at(image.camera_id);
    task.path = image_path / image.name;
    // An image that the files do not have has no segments.
    if (!options.imports.segments.empty()) task.imported = &(*imported)[image_id];
    if (!options.mask_path.empty()) task.mask = MaskOf(options.mask_path, image.name);
    tasks.push_back(std::move(task));
  }
  ParallelTasks(options.num_threads, tasks.size(),
                [&](size_t i) { AddSettings(options.extraction, options.vps, &tasks[i]); });
  for (ImageTask& task : tasks) ReadStored(*database, &task);

  std::vector<ImageTask*> open;
  for (ImageTask& task : tasks) {
    if (!task.has_vps) open.push_back(&task);
  }
  report->num_images = tasks.size();
  report->images_reused = tasks.size() - open.size();
  for (size_t begin = 0; begin < open.size(); begin += kImagesPerWrite) {
    const size_t count = std::min(kImagesPerWrite, open.size() - begin);
    ParallelTasks(options.num_threads, count, [&](size_t i) {
      ImageTask& task = *open[begin + i];
      try {
        Detect(options, &task);
      } catch (const InputError& error) {
        task.fault = error.what();
        task.features = {};
      }
    });
    Database::Transaction transaction(database);
    for (size_t i = 0; i < count; ++i) {
      const ImageTask& task = *open[begin + i];
      if (task.fault) {
        report->left_out.push_back({task.image_id, *task.fault});
      } else {
        StoreStructure(task, database);
      }
      if (task.is_cut_off && !task.fault) report->cut_off.push_back(task.image->name);
    }
    transaction.Commit();
    if (options.strict && !report->left_out.empty()) break;
  }
  HandleLeftOut(options.strict, *report);

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
