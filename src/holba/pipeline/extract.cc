// SPDX-License-Identifier: BSD-3-Clause
#include "holba/pipeline/extract.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <limits>
#include <memory>
#include <mutex>
#include <utility>

#include "holba/base/error.h"
#include "holba/base/log.h"
#include "holba/base/threads.h"
#include "holba/base/timer.h"
#include "holba/base/words.h"
#include "holba/frontend/detectors/onnx_image.h"
#include "holba/frontend/detectors/onnx_points.h"
#include "holba/frontend/importers/import_points.h"
#include "holba/frontend/importers/import_regions.h"
#include "holba/frontend/photographs/photograph.h"
#include "holba/pipeline/image_structure.h"
#include "holba/pipeline/left_out.h"
#include "holba/pipeline/settings.h"

namespace holba {
namespace fs = std::filesystem;
namespace {

// Between the reading of a photograph and the database.
struct Found {
  std::optional<SiftFeatures> points;  // empty: kept
  StructureTask structure;
  bool has_structure = false;  // it is to be stored
  ExtractReport::OfImage report;
};

class Extractor {
 public:
  Extractor(const ExtractOptions& options, const fs::path& image_path, Database* database,
            const std::function<void(size_t, size_t)>& progress)
      : options_(options), database_(database), progress_(progress) {
    plan_ = PlanCameras(options.reader, image_path,
                        PhotographNames(image_path, options.image_list_path), *database,
                        options.num_threads);
    for (const CameraPlan::PlannedCamera& camera : plan_.cameras)
      straight_cameras_.push_back(AsPinholeIfStraight(camera.camera.camera));
    report_.images.resize(plan_.images.size());
    found_.resize(plan_.images.size());
    is_found_.resize(plan_.images.size());
    if (options.structure && !options.imports.segments.empty()) ReadImportedSegments();
    if (!options.points_path.empty()) ReadImportedPoints();
    // A fault of a model is that of the run, not of the first photograph.
    if (!options.onnx_points_path.empty())
      point_model_ = SharedOnnxModel(options.onnx_points_path, OnnxKind::kPoints);
    const SegmentOptions& segments = options.extraction.segments;
    if (options.structure && segments.detector == "onnx" && !segments.model_path.empty())
      SharedOnnxModel(segments.model_path, OnnxKind::kSegments);
  }

  ExtractReport Run() {
    ParallelTasks(options_.num_threads, plan_.images.size(), [&](size_t i) {
      if (i > first_fault_) return;
      Found found = Find(i);
      const std::lock_guard lock(mutex_);
      Keep(i, std::move(found));
    });
    Judge();
    if (options_.structure && !options_.imports.labels.empty()) ImportRegionsOfImages();
    for (const CameraPlan::PlannedCamera& camera : plan_.cameras) {
      if (!camera.camera_id) continue;
      ++report_.num_cameras;
      report_.num_cameras_with_prior_focal_length += camera.camera.has_prior_focal_length;
    }
    return std::move(report_);
  }

 private:
  // Images by their place in the order of names, from 1: importers know images by names.
  Reconstruction ModelOfPlan() const {
    Reconstruction model;
    for (size_t k = 0; k < plan_.cameras.size(); ++k)
      model.cameras.Add(static_cast<camera_t>(k + 1), straight_cameras_[k]);
    for (size_t i = 0; i < plan_.images.size(); ++i) {
      const PlannedImage& planned = plan_.images[i];
      if (planned.fault) continue;
      Image image;
      image.name = planned.name;
      image.camera_id = static_cast<camera_t>(planned.camera_idx + 1);
      model.images.Add(static_cast<image_t>(i + 1), std::move(image));
    }
    return model;
  }

  void ReadImportedSegments() {
    SegmentImportReport imported;
    imported_ = ImportSegments(options_.imports.segments, ModelOfPlan(), options_.segment_import,
                               &imported);
    for (size_t i = 0; i < plan_.images.size(); ++i) imported_[static_cast<image_t>(i + 1)];
    for (const auto& [reason, count] : imported.dropped) report_.dropped[reason] += count;
    LogInfo("Imported {} of {}; {} {} not in the files", Counted(imported.num_segments, "segment"),
            Counted(imported.num_images, "image"), Counted(imported.num_images_without, "other"),
            Agree(imported.num_images_without, "is", "are"));
  }

  void ReadImportedPoints() {
    PointImportReport imported;
    imported_points_ = ImportPoints(options_.points_path, ModelOfPlan(), &imported);
    // Threads find their entries, they add none.
    for (size_t i = 0; i < plan_.images.size(); ++i) imported_points_[static_cast<image_t>(i + 1)];
    LogInfo("Imported {} of {}; {} {} not in the files and without points",
            Counted(imported.num_points, "point"), Counted(imported.num_images, "image"),
            Counted(imported.num_images_without, "other"),
            Agree(imported.num_images_without, "is", "are"));
  }

  Found Find(size_t i) {
    const PlannedImage& planned = plan_.images[i];
    Found found;
    found.report.name = planned.name;
    found.report.fault = planned.fault;
    if (planned.fault) return found;
    try {
      FindPointsAndStructure(i, &found);
    } catch (const InputError& error) {
      found.report.fault = error.what();
    }
    return found;
  }

  void FindPointsAndStructure(size_t i, Found* found) {
    const PlannedImage& planned = plan_.images[i];
    StructureTask& task = found->structure;
    task.name = planned.name;
    task.camera = &straight_cameras_[planned.camera_idx];
    task.path = planned.path;
    if (!options_.reader.mask_path.empty())
      task.mask = MaskOf(options_.reader.mask_path, planned.name);
    task.camera_mask = options_.reader.camera_mask_path;
    if (!options_.imports.segments.empty())
      task.imported = &imported_.at(static_cast<image_t>(i + 1));
    if (options_.structure) {
      AddSettings(options_.extraction, options_.vps, &task);
    }
    ReadWhatIsThere(planned, found);
    const bool wants_points = !found->report.points_kept;
    const bool wants_structure = options_.structure && !task.has_vps;
    found->report.structure_kept = options_.structure && task.has_vps;
    const bool wants_sift = wants_points && options_.points_path.empty();
    if (wants_points && !wants_sift) {
      // An image that the files do not have has no points.
      ImportedPoints& imported = imported_points_.at(static_cast<image_t>(i + 1));
      found->points = {std::move(imported.keypoints), std::move(imported.descriptors)};
      found->report.num_keypoints = found->points->keypoints.size();
    }
    if (wants_sift || (wants_structure && !task.has_features)) {
      const GreyImage photograph = ReadPhotograph(planned, &found->report);
      const std::optional<GreyImage> mask = ReadMasks(task);
      if (wants_sift) {
        const GreyImage* mask_or_null = mask ? &*mask : nullptr;
        found->points =
            point_model_
                ? DetectOnnxPoints(*point_model_, ReadColourImage(planned.path), mask_or_null)
                : DetectSift(options_.sift, photograph, mask_or_null,
                             90.0 * QuarterTurnsToUpright(planned.header.exif));
        found->report.num_keypoints = found->points->keypoints.size();
      }
      if (wants_structure) {
        DetectStructure(options_.extraction, options_.vps, &photograph, mask ? &*mask : nullptr,
                        &task);
      }
    } else if (wants_structure) {
      DetectStructure(options_.extraction, options_.vps, nullptr, nullptr, &task);
    }
    found->has_structure = wants_structure;
    found->report.num_segments = task.features.segments.size();
    found->report.num_corners = task.features.corners.size();
    found->report.num_vanishing_points = task.features.vanishing_points.size();
  }

  // The database is asked by one thread at a time.
  void ReadWhatIsThere(const PlannedImage& planned, Found* found) {
    if (!planned.image_id) return;
    const std::lock_guard lock(mutex_);
    const std::optional<size_t> num_keypoints = database_->NumKeypoints(*planned.image_id);
    // As COLMAP: an image is done if it has both.
    found->report.points_kept = num_keypoints && database_->HasDescriptors(*planned.image_id);
    found->report.num_keypoints = num_keypoints.value_or(0);
    found->structure.database_id = *planned.image_id;
    if (options_.structure) ReadStored(*database_, &found->structure);
  }

  GreyImage ReadPhotograph(const PlannedImage& planned, ExtractReport::OfImage* report) const {
    GreyImage photograph =
        ReadPhotographOfSize(planned.path, planned.header.width, planned.header.height,
                             "its header and its pixels contradict each other: save it anew");
    report->is_cut_off = photograph.ends_early;
    return photograph;
  }

  // Images are written in their order: what is found earlier waits. Under the lock.
  void Keep(size_t i, Found found) {
    // A strict run ends with the first fault in the order of the images, whichever thread is ahead.
    if (options_.strict && found.report.fault) first_fault_ = std::min(i, first_fault_.load());
    found_[i] = std::move(found);
    is_found_[i] = true;
    while (num_kept_ < found_.size() && num_kept_ <= first_fault_ && is_found_[num_kept_]) {
      Found& next = found_[num_kept_];
      if (!next.report.fault) Store(plan_.images[num_kept_], &next);
      report_.images[num_kept_] = std::move(next.report);
      next = {};
      ++num_kept_;
      if (progress_) progress_(num_kept_, found_.size());
    }
  }

  void Store(const PlannedImage& planned, Found* found) {
    CameraPlan::PlannedCamera& camera = plan_.cameras[planned.camera_idx];
    ExtractReport::OfImage& report = found->report;
    Database::Transaction transaction(database_);
    std::optional<camera_t> camera_id = camera.camera_id;
    image_t image_id = planned.image_id.value_or(kInvalidId32);
    if (!planned.image_id) {
      if (!camera_id) camera_id = database_->AddCamera(std::nullopt, camera.camera);
      image_id = database_->AddImage(std::nullopt, {planned.name, *camera_id});
      if (!planned.prior.empty()) database_->WritePosePrior(image_id, *camera_id, planned.prior);
    }
    if (found->points) {
      database_->WriteKeypoints(image_id, found->points->keypoints);
      database_->WriteDescriptors(image_id, found->points->descriptors);
    }
    if (found->has_structure) {
      found->structure.database_id = image_id;
      StoreStructure(found->structure, database_);
    }
    transaction.Commit();
    camera.camera_id = camera_id;
    report.camera_id = *camera_id;
    report.has_pose_prior = !planned.prior.empty();
  }

  // Says which photographs are left out; throws if that is not wanted, or if none is left.
  void Judge() {
    std::vector<LeftOutPhotograph> left_out;
    std::vector<std::string> cut_off;
    size_t num_kept = 0;
    for (const ExtractReport::OfImage& image : report_.images) {
      if (image.fault) left_out.push_back({kInvalidId32, *image.fault});
      if (image.is_cut_off) cut_off.push_back(image.name);
      num_kept += image.points_kept;
    }
    HandleLeftOut(options_.strict, left_out, report_.images.size(), "");
    WarnOfCutOff(cut_off);
    if (num_kept > 0) {
      LogInfo(
          "{} {} key points in the database, which are kept (to make them anew, use another "
          "database)",
          Counted(num_kept, "image"), Agree(num_kept, "has", "have"));
    }
  }

  // Label maps belong to images of the database, whenever they were extracted.
  void ImportRegionsOfImages() {
    const Reconstruction model = ModelOfPlan();
    ImageFeatureMap features;
    RegionImportReport regions;
    ImportRegions({options_.imports.labels, options_.imports.normals, options_.imports.depths},
                  model, options_.region_normals, options_.num_threads, &features, &regions);
    report_.num_labelled_regions = regions.num_regions;
    for (const auto& [reason, count] : regions.dropped) report_.dropped[reason] += count;
    const std::string settings = SettingsText("imported", options_.region_normals);
    Database::Transaction transaction(database_);
    for (const auto& [id, f] : features) {
      const auto image_id = database_->FindImage(plan_.images[id - 1].name);
      if (!image_id) continue;  // its photograph is left out
      database_->WriteLabelMap(*image_id, settings, f.label_map);
      database_->WriteNormals(*image_id, settings, f.normals);
    }
    transaction.Commit();
  }

  const ExtractOptions& options_;
  Database* database_;
  const std::function<void(size_t, size_t)>& progress_;
  CameraPlan plan_;
  std::vector<Camera> straight_cameras_;          // of the plan's cameras
  std::map<image_t, ImportedSegments> imported_;  // by the ids of ModelOfPlan
  std::map<image_t, ImportedPoints> imported_points_;
  std::shared_ptr<const DescribedModel> point_model_;  // null: SIFT
  ExtractReport report_;
  // Of a strict run; changed under the lock.
  std::atomic<size_t> first_fault_ = std::numeric_limits<size_t>::max();
  std::mutex mutex_;  // of the database and of what follows
  std::vector<Found> found_;
  std::vector<bool> is_found_;
  size_t num_kept_ = 0;
};

}  // namespace

void ExtractOptions::Describe(OptionTable* table) const {
  DescribePoints(table);
  imports.Describe(table);
  segment_import.Describe(table);
  region_normals.Describe(table);
  table->Section("Extraction");
  table
      ->Field("structure", &structure,
              "Whether structure is looked for, too: segments, corners, vanishing points.")
      .Basic();
  table
      ->Field(
          "num_threads", &num_threads, AtLeast(-1),
          "Photographs that are worked on at a time (-1 for one per hardware thread). The result "
          "does not depend on it.")
      .Basic();
  extraction.Describe(table);
  vps.Describe(table);
}

void ExtractOptions::DescribePoints(OptionTable* table) const {
  table->Field("image_list_path", &image_list_path,
               "File with the names of the photographs that are used, one a line; empty: all below "
               "the folder.");
  table->Field(
      "strict", &strict,
      "Whether a photograph that cannot be used stops the run, instead of being left out.");
  reader.Describe(table);
  sift.Describe(table);
  table->Section("Onnx");
  table->Field("points_path", &onnx_points_path,
               "JSON file that describes an ONNX model of yours, which finds key points and "
               "descriptors instead of SIFT.");
  table->Section("Import");
  table->Field("points_path", &points_path,
               "Key points and descriptors as hloc writes them (HDF5, npz, npy), used instead of "
               "SIFT.");
}

void ExtractOptions::Check() const {
  reader.Check();
  imports.Check();
  if (!points_path.empty() && !onnx_points_path.empty()) {
    throw InputError(
        "--Import.points_path and --Onnx.points_path both bring key points; give one of them");
  }
  if (!structure && (!imports.segments.empty() || !imports.labels.empty())) {
    throw InputError(
        "--Import.segments_path and --Import.labels_path must go with --Extraction.structure 1, as "
        "what they bring is structure");
  }
  if (!imports.line_matches.empty() || !imports.correspondences.empty()) {
    throw InputError(
        "--Import.line_matches_path and --Import.correspondences_path say something about pairs of "
        "images; give them to 'holba refine'");
  }
}

ExtractReport ExtractFeaturesOf(const ExtractOptions& options, const fs::path& image_path,
                                Database* database,
                                const std::function<void(size_t, size_t)>& progress) {
  const Timer timer;
  ExtractReport report = Extractor(options, image_path, database, progress).Run();
  report.seconds = timer.Seconds();
  return report;
}

}  // namespace holba
