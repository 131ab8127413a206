// SPDX-License-Identifier: BSD-3-Clause
// The geometry of two views from matches of their keypoints, with COLMAP's configurations and rules
// for them: essential matrix, fundamental matrix and homography compete by their numbers of
// inliers.
#pragma once

#include <cstdint>
#include <span>
#include <string_view>

#include "holba/base/options.h"
#include "holba/estimation/two_view/two_view_ransac.h"
#include "holba/scene/keypoints.h"
#include "holba/scene/two_view_geometry.h"

namespace holba {

// Names and defaults are COLMAP's.
struct TwoViewOptions {
  int min_num_inliers = 15;
  double max_error = 4.0;
  double confidence = 0.999;
  int max_num_trials = 10000;
  double min_inlier_ratio = 0.25;
  double min_E_F_inlier_ratio = 0.95;
  double max_H_inlier_ratio = 0.8;
  bool detect_watermark = true;
  double watermark_min_inlier_ratio = 0.7;
  double watermark_border_size = 0.1;
  double watermark_detection_max_error = 4.0;
  bool multiple_models = false;
  bool multiple_ignore_watermark = true;
  bool filter_stationary_matches = false;
  double stationary_matches_max_error = 4.0;
  bool compute_relative_pose = true;
  int random_seed = 0;

  void Describe(OptionTable* table) const;
};

struct TwoViewEnd {
  const Camera* camera = nullptr;
  // Whether the camera's focal length is known; both ends': essential matrices are looked for.
  bool is_calibrated = false;
  const Keypoints* keypoints = nullptr;
};

enum class TwoViewFailure { kNone, kFewMatches, kFewInliers, kWatermark };
std::string_view NameOf(TwoViewFailure failure);  // a phrase for reports

struct TwoViewResult {
  TwoViewGeometry geometry;
  TwoViewFailure failure = TwoViewFailure::kNone;
  size_t num_inliers_E = 0, num_inliers_F = 0, num_inliers_H = 0;
  int num_samples = 0;
  double median_angle_deg = 0.0;  // of the rays of the inliers; 0: no relative pose
};

// `matches`: indices of keypoints, each pair once; with `best_first` in descending order of
// quality, by which they are sampled. The inliers are in the order of the matches. `pair_seed` and
// options.random_seed determine the result.
TwoViewResult EstimateTwoView(const TwoViewOptions& options, const TwoViewEnd& end1,
                              const TwoViewEnd& end2, const PointMatches& matches, bool best_first,
                              uint64_t pair_seed);

}  // namespace holba
