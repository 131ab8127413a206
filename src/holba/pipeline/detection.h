// SPDX-License-Identifier: BSD-3-Clause
// What is in the photographs of a model: detected, imported or taken from the database, and kept
// there.
#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "holba/estimation/directions/vanishing_points.h"
#include "holba/frontend/detectors/feature_extractor.h"
#include "holba/frontend/importers/import_dense_maps.h"
#include "holba/frontend/importers/import_segments.h"
#include "holba/io/database.h"
#include "holba/pipeline/left_out.h"
#include "holba/pipeline/photograph_folder.h"
#include "holba/scene/image_features.h"
#include "holba/scene/reconstruction.h"

namespace holba {

// Files of other programs (docs/import.md); empty: none.
struct ImportPaths {
  std::string segments;
  std::string line_matches;
  std::string labels;
  std::string normals;
  std::string depths;
  std::string correspondences;

  void Describe(OptionTable* table) const;
  // Throws InputError for what is not there, before anything is computed or written.
  void Check() const;
};

struct DetectionOptions {
  // Folder of masks as COLMAP's --ImageReader.mask_path has them: for the image NAME the file
  // NAME.png (or NAME with the extension .png), with 0 where no features are. Empty: none.
  std::string mask_path;
  std::string camera_mask_path;  // one for all; empty: none. No option of its own: ImageReader's.
  // Pictures that are to be left out are an InputError.
  bool strict = false;
  ImportPaths imports;
  SegmentImportOptions segment_import;
  RegionNormalOptions region_normals;
  ExtractionOptions extraction;
  VanishingPointOptions vps;
  int num_threads = -1;

  void Describe(OptionTable* table) const;
  // All but the masks.
  void DescribeStructure(OptionTable* table) const;
  // Throws InputError for folders and files that are not there.
  void Check() const;
};

struct DetectionReport {
  size_t num_images = 0;
  size_t images_reused = 0;  // all of it was in the database
  size_t num_segments = 0, num_corners = 0, num_vanishing_points = 0, num_labelled_regions = 0;
  std::map<std::string, size_t> dropped;    // of imports
  std::vector<LeftOutPhotograph> left_out;  // their images stay in the model
  std::vector<std::string> cut_off;         // names of images whose file ends early
  double detect_seconds = 0.0;
};

// Features of every image of the model; of one whose photograph is left out: none. Throws
// InputError if that is so for all. `database_id`: Database::MatchImages. `imported`: the segments
// of other programs, where there are such.
ImageFeatureMap DetectFeatures(const DetectionOptions& options, const PhotographFolder& image_path,
                               const Reconstruction& model,
                               const std::map<image_t, image_t>& database_id, Database* database,
                               std::map<image_t, ImportedSegments>* imported,
                               DetectionReport* report);

// The database's names of images of the model that it has under another one (scene/name_pairing.h),
// for Database::MatchImages; said on the log. Names alone are not believed: pairs by the ends of
// their paths count only where keypoints show that the photographs are the same. Throws InputError
// if the keypoints of most of the database's images that have names of the model are others than
// the model's, and it does not know the photographs either: it is of another set, whose names are
// alike.
std::map<std::string, std::string> CheckDatabase(const Database& database,
                                                 const PhotographFolder& image_path,
                                                 const Reconstruction& model);

// One line, for the log.
std::string DetectionText(const DetectionReport& report, const std::filesystem::path& database);

}  // namespace holba
