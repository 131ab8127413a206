// SPDX-License-Identifier: BSD-3-Clause
// The two-view model of the greatest gain among matches of which many may be wrong: RANSAC with
// local optimisation (Chum, Matas, Kittler 2003), samples of the best matches first where their
// order is known (PROSAC, Chum and Matas 2005), the gain of two_view_kernels.h, which needs no
// threshold that tells right from wrong. A hypothesis is dropped as soon as what is left of the
// matches cannot make it the best: exact, unlike tests of random matches. The best model is then
// fitted with the noise that its own inliers show, so that what agrees with it by chance, a few
// pixels off, does not pull at it. Of an essential matrix only the matches count that its best pose
// has in front of both cameras: of a plane there are two matrices for all matches, and mostly this
// alone tells which is right.
#pragma once

#include <cstdint>
#include <optional>

#include "holba/estimation/two_view/two_view_refinement.h"

namespace holba {

struct TwoViewRansacOptions {
  // Of an inlier. The thresholds of the gain are about it: their squares up to twice its square.
  double max_error_px = 4.0;
  // Samples are drawn until a right one has been among them with this probability, if the share of
  // right matches is that of the best model so far, and as many times more as `multiplier` says:
  // a sample of right matches with noise is not always a good one.
  double confidence = 0.999;
  double multiplier = 3.0;
  int min_num_samples = 100;
  int max_num_samples = 10000;
  // Models with a smaller share of the matches are not looked for.
  double min_inlier_ratio = 0.25;
  bool best_first = false;  // matches are in descending order of quality
  uint64_t seed = 0;
};

struct TwoViewFit {
  Eigen::Matrix3d model;
  double gain = 0.0;
  double sigma_px = 0.0;          // of the errors of the inliers
  // Within max_error_px; of an essential matrix in front of both cameras. Ascending.
  std::vector<uint32_t> inliers;
  size_t num_near = 0;  // within max_error_px, on whatever side
  int num_samples = 0;
};

// `start`: a model that is considered too, or null. Empty: too few matches, or no model that more
// matches agree with than determine it.
std::optional<TwoViewFit> FitTwoView(TwoViewKind kind, const MatchedRays& matches,
                                     const TwoViewRansacOptions& options,
                                     const Eigen::Matrix3d* start = nullptr);

// Of a given model.
std::vector<uint32_t> InliersOf(TwoViewKind kind, const Eigen::Matrix3d& model,
                                const MatchedRays& matches, double max_error_px);

}  // namespace holba
