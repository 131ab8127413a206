// SPDX-License-Identifier: BSD-3-Clause
// Poses of new photographs in a finished model, from the points, lines and directions of it that
// they see. The model's own cameras, points and lines stay as they are.
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "holba/base/options.h"
#include "holba/estimation/pose/absolute_pose.h"
#include "holba/io/database.h"
#include "holba/pipeline/extract.h"
#include "holba/pipeline/match_points.h"
#include "holba/pipeline/match_segments.h"
#include "holba/scene/reconstruction.h"

namespace holba {

enum class LocalizeFrom { kPoints, kPointsAndLines, kAll };

struct LocalizeOptions {
  LocalizeOptions();

  std::string image_list_path;  // a name a line; empty: the folder's photographs without a pose
  LocalizeFrom from = LocalizeFrom::kAll;
  int max_num_neighbors = 30;
  AbsolutePoseOptions pose;
  int random_seed = 0;
  ExtractOptions extract;
  MatchPointsOptions matching;
  LineMatchingOptions segments;

  void Describe(OptionTable* table) const;
  // Throws InputError for files that are not there and options that do not go together.
  void Check() const;
};

struct LocalizedImage {
  std::string name;
  std::optional<image_t> database_id;
  std::optional<image_t> image_id;  // in the model, where it has a pose now
  // Why there is no pose.
  std::string failure;
  std::optional<AbsolutePose> pose;
  Camera camera;  // with the intrinsics that the pose goes with
  bool focal_was_known = false;
  size_t num_neighbours = 0;  // images of the model with which matches are shared
  ForEachKind<size_t> num_matches;

  // Standard deviations that the covariance says: of the centre along its worst direction (model
  // units), of the rotation about its worst axis.
  double CentreSigma() const;
  double RotationSigmaDeg() const;
};

struct LocalizeReport {
  std::vector<LocalizedImage> images;  // in the order of their names
  size_t num_localized = 0;
  double extract_seconds = 0.0, match_seconds = 0.0, pose_seconds = 0.0;
};

// What is found and matched goes into `database`, which has, or gets, the features of the model's
// images; the localised images go into the model with what they were seen to observe.
// `work_folder`: for small files while it runs. `progress` (may be empty): a step's name, and how
// much of it is done. Same arguments: same bits, whatever the number of threads. Throws InputError.
LocalizeReport Localize(
    const LocalizeOptions& options, const std::filesystem::path& image_path,
    const std::filesystem::path& work_folder, Database* database, Reconstruction* model,
    const std::function<void(const std::string& step, size_t num_done, size_t num_all)>& progress);

}  // namespace holba
