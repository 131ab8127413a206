// SPDX-License-Identifier: BSD-3-Clause
// A folder of photographs into a COLMAP database: cameras, images, points with descriptors and, in
// the same pass, the structure that `refine` works with.
#pragma once

#include <filesystem>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "holba/base/options.h"
#include "holba/frontend/detectors/sift_detector.h"
#include "holba/io/database.h"
#include "holba/pipeline/detection.h"
#include "holba/pipeline/photograph_cameras.h"

namespace holba {

struct ExtractOptions {
  std::string image_list_path;  // a name a line; empty: all photographs of the folder
  ImageReaderOptions reader;
  SiftOptions sift;
  // Segments, corners, vanishing points and imported regions, as `refine` looks for them.
  bool structure = true;
  ImportPaths imports;
  // Key points and descriptors of another program (import_points.h), instead of SIFT; empty: SIFT.
  std::string points_path;
  // JSON file of a user's ONNX model, instead of SIFT; empty: SIFT.
  std::string onnx_points_path;
  SegmentImportOptions segment_import;
  RegionNormalOptions region_normals;
  ExtractionOptions extraction;
  VanishingPointOptions vps;
  bool strict = false;  // a photograph that cannot be used is an InputError
  int num_threads = -1;

  void Describe(OptionTable* table) const;
  // Only what says which photographs, cameras and points: for a command that has the other options
  // from elsewhere.
  void DescribePoints(OptionTable* table) const;
  // Throws InputError for files that are not there and options that do not go together.
  void Check() const;
};

struct ExtractReport {
  struct OfImage {
    std::string name;
    std::optional<std::string> fault;  // why it was left out
    bool points_kept = false;          // it had key points in the database, whoever made them
    bool structure_kept = false;       // the database had what would be found now
    bool is_cut_off = false;           // its file ends early
    camera_t camera_id = kInvalidId32;
    size_t num_keypoints = 0, num_segments = 0, num_corners = 0, num_vanishing_points = 0;
    bool has_pose_prior = false;
  };
  std::vector<OfImage> images;  // in the order of their names
  size_t num_cameras = 0, num_cameras_with_prior_focal_length = 0;
  size_t num_labelled_regions = 0;
  std::map<std::string, size_t> dropped;  // of imports
  double seconds = 0.0;
};

// Writes image by image, each in one transaction, in the order of the names: a run that is killed
// leaves a whole database, and the next one goes on behind it to the same result. What an image has
// already is kept: key points of any program, structure that was made with these options. Same
// photographs and options: same database, whatever the number of threads. `progress` (may be
// empty): called after each image, from one thread at a time. Throws InputError if no photograph
// can be used, or (strict) one cannot.
ExtractReport ExtractFeaturesOf(
    const ExtractOptions& options, const std::filesystem::path& image_path, Database* database,
    const std::function<void(size_t num_done, size_t num_all)>& progress);

}  // namespace holba
