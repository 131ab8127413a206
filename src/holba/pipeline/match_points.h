// SPDX-License-Identifier: BSD-3-Clause
// Matches of the point features of a database's images, verified by the geometry of their views:
// COLMAP's tables `matches` and `two_view_geometries`. Pairs that are there already stay as they
// are, so that a run that was stopped goes on where it ended; pairs are written in groups, each as
// a whole.
#pragma once

#include <functional>
#include <map>
#include <string>
#include <vector>

#include "holba/base/options.h"
#include "holba/estimation/two_view/two_view_estimation.h"
#include "holba/frontend/matching/descriptor_matching.h"
#include "holba/io/database.h"

namespace holba {

// Names and defaults are COLMAP's.
struct MatchPointsOptions {
  DescriptorMatchOptions descriptors;
  TwoViewOptions geometry;
  int max_num_matches = 32768;
  bool guided_matching = false;
  bool skip_geometric_verification = false;
  bool keep_repetition = true;
  std::string onnx_matcher_path;  // JSON file of a user's model that matches; empty: descriptors
  int max_images_in_memory = 100;
  int num_threads = -1;

  void Describe(OptionTable* table) const;
  void DescribeMatching(OptionTable* table) const;  // all but the number of threads
};

struct MatchedPairReport {
  ImagePair pair;
  size_t num_matches = 0, num_inliers = 0;
  TwoViewConfig config = TwoViewConfig::kUndefined;
  double median_angle_deg = 0.0;
};

struct MatchPointsReport {
  size_t num_pairs = 0, pairs_reused = 0;  // reused: was in the database
  size_t num_verified = 0;                 // pairs with a geometry, and their matches
  size_t num_matches = 0, num_inliers = 0;
  std::map<std::string, size_t> num_of_config;  // of pairs with a geometry: calibrated, planar, ...
  std::map<std::string, size_t> dropped;        // pairs without geometry, by reason
  std::vector<std::string> without_features;    // names of images that cannot be matched
  std::vector<MatchedPairReport> pairs;         // with a geometry
  double seconds = 0.0;
  double match_cpu_seconds = 0.0, verify_cpu_seconds = 0.0;  // of all threads
};

// What a pair has several times (scene/pair_repetition.h) is kept with these settings: the limits
// of matching, and the inliers that it was measured for. `geometry`: of the image with the smaller
// id first.
std::string RepetitionSettings(const DescriptorMatchOptions& options,
                               const TwoViewGeometry& geometry);

// Calls `progress` with the number of pairs that are done, after each group of pairs.
MatchPointsReport MatchPoints(const MatchPointsOptions& options,
                              const std::vector<ImagePair>& pairs, Database* database,
                              const std::function<void(size_t num_done)>& progress);

}  // namespace holba
