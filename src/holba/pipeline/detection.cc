// SPDX-License-Identifier: BSD-3-Clause
#include "holba/pipeline/detection.h"

#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <utility>
#include <vector>

#include "holba/base/error.h"
#include "holba/base/file_faults.h"
#include "holba/base/log.h"
#include "holba/base/progress.h"
#include "holba/base/threads.h"
#include "holba/base/timer.h"
#include "holba/base/words.h"
#include "holba/frontend/importers/import_regions.h"
#include "holba/frontend/photographs/photograph.h"
#include "holba/pipeline/image_structure.h"
#include "holba/pipeline/settings.h"
#include "holba/scene/name_pairing.h"

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
    mask = ReadMasks(*task);
  }
  DetectStructure(options.extraction, options.vps, photograph ? &*photograph : nullptr,
                  mask ? &*mask : nullptr, task);
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

struct DatabasePair {
  const Image* image;
  image_t database_id;
  std::string database_name;
};

// How many of `pairs` have keypoints to compare, and the images that have others in the database.
struct ComparedPairs {
  size_t num_compared = 0;
  std::vector<const Image*> others;
};

ComparedPairs Compare(const std::vector<DatabasePair>& pairs, const Database& database,
                      const PhotographFolder& image_path) {
  constexpr size_t kMaxNumChecked = 20;  // evenly spread: the answer is the same for all
  ComparedPairs result;
  const size_t count = std::min(pairs.size(), kMaxNumChecked);
  for (size_t k = 0; k < count; ++k) {
    const auto& [image, id, name] = pairs[k * pairs.size() / count];
    const std::optional<Keypoints> keypoints = database.ReadKeypoints(id);
    const std::optional<bool> same = keypoints ? HasKeypointsOf(*image, *keypoints) : std::nullopt;
    if (!same) continue;
    ++result.num_compared;
    if (*same) continue;
    // The same photographs with other keypoints are those that were looked at before.
    const std::optional<std::string> settings = database.ReadSegmentSettings(id);
    if (settings && settings->find(PhotographText(image_path / image->name)) != std::string::npos)
      continue;
    result.others.push_back(image);
  }
  return result;
}

}  // namespace

std::map<std::string, std::string> CheckDatabase(const Database& database,
                                                 const PhotographFolder& image_path,
                                                 const Reconstruction& model) {
  std::vector<const Image*> images;
  std::vector<std::string_view> names, database_names;
  for (const auto& [image_id, image] : model.images) {
    images.push_back(&image);
    names.push_back(image.name);
  }
  const std::map<image_t, DatabaseImage> in_database = database.ReadImages();
  if (in_database.empty()) return {};
  std::vector<image_t> database_ids;
  for (const auto& [image_id, image] : in_database) {
    database_ids.push_back(image_id);
    database_names.push_back(image.name);
  }
  const NamePairing pairing = PairNames(names, database_names);
  std::vector<DatabasePair> whole, by_ending;
  for (size_t i = 0; i < names.size(); ++i) {
    if (!pairing.b_of_a[i]) continue;
    const size_t j = *pairing.b_of_a[i];
    const bool is_whole = names[i] == database_names[j];
    (is_whole ? whole : by_ending)
        .push_back({images[i], database_ids[j], std::string(database_names[j])});
  }
  const ComparedPairs of_whole = Compare(whole, database, image_path);
  const ComparedPairs of_ending = Compare(by_ending, database, image_path);
  for (const ComparedPairs& compared : {of_whole, of_ending}) {
    if (2 * compared.others.size() <= compared.num_compared) continue;
    throw InputError(
        database.path(),
        fmt::format(
            "of {} with names of the model, {} have other keypoints here (first '{}'), so that "
            "this is the database of other photographs; give the one that the model was made "
            "from (--database_path), or a file that does not exist yet",
            Counted(compared.num_compared, "image"), compared.others.size(),
            compared.others.front()->name));
  }
  std::map<std::string, std::string> name_in_database;
  if (of_ending.num_compared > 0) {
    for (const DatabasePair& pair : by_ending)
      name_in_database.emplace(pair.image->name, pair.database_name);
    LogInfo("{}: {}", database.path().string(),
            HowPaired("image", whole.size(), by_ending.size(), pairing.examples));
  } else if (!by_ending.empty()) {
    LogWarning(
        "{}: {} of the database may be of this model under other names ({}), but without keypoints "
        "nothing shows it; the model's images are added",
        database.path().string(), Counted(by_ending.size(), "image"), pairing.examples);
  } else if (whole.empty()) {
    LogWarning(
        "{}: none of the database's images ({} of them) is of this model, whose images are added",
        database.path().string(), in_database.size());
  }
  return name_in_database;
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
      throw NoSuchFileOrFolder(*path, fmt::format("--Import.{}", name));
    }
  }
  if (!line_matches.empty() && segments.empty()) {
    throw InputError(
        "--Import.line_matches_path must go with --Import.segments_path, as its indices count the "
        "segments of its detector");
  }
  if (!labels.empty()) return;
  for (const auto& [name, path] : {std::pair("normals_path", &normals),
                                   {"depths_path", &depths},
                                   {"correspondences_path", &correspondences}}) {
    if (!path->empty()) {
      throw InputError(
          fmt::format("--Import.{} must go with --Import.labels_path, as it says something about "
                      "labelled regions",
                      name));
    }
  }
}

void DetectionOptions::Check() const {
  if (!mask_path.empty() && !fs::is_directory(mask_path))
    throw NoSuchFolder(mask_path, "--mask_path");
  imports.Check();
}

void DetectionOptions::Describe(OptionTable* table) const {
  table->Section("");
  table->Field("mask_path", &mask_path,
               "Folder of masks, as COLMAP's --ImageReader.mask_path: no features where the image "
               "NAME.png is 0 (segments of other programs are taken as they are).");
  DescribeStructure(table);
}

void DetectionOptions::DescribeStructure(OptionTable* table) const {
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
    LogInfo("Imported {} of {}; {} of the model {} no segments in the files",
            Counted(import_report.num_segments, "segment"),
            Counted(import_report.num_images, "image"),
            Counted(import_report.num_images_without, "image"),
            Agree(import_report.num_images_without, "has", "have"));
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
    task.camera_mask = options.camera_mask_path;
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
  Progress progress("Finding segments", "images", open.size());
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
      progress.Advance();
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
  HandleLeftOut(options.strict, report->left_out, report->num_images,
                "points seen there take part, nothing else is looked for");
  WarnOfCutOff(report->cut_off);

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
    LogInfo("Imported label maps of {} ({} {} none): {}, {}", Counted(regions.num_maps, "image"),
            regions.num_images_without, Agree(regions.num_images_without, "has", "have"),
            Counted(regions.num_regions, "region"), Counted(regions.num_normals, "normal"));
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
  return fmt::format("{}: {}, {}, {} ({} detected now, {} in {}), {:.1f} s",
                     Counted(report.num_images, "image"), Counted(report.num_segments, "segment"),
                     Counted(report.num_vanishing_points, "vanishing point"),
                     Counted(report.num_corners, "corner"),
                     Counted(report.num_images - report.images_reused, "image"),
                     report.images_reused, database.string(), report.detect_seconds);
}

}  // namespace holba
