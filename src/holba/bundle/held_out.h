// SPDX-License-Identifier: BSD-3-Clause
// Point tracks that an adjustment does not see, and how well the cameras that it finds predict
// them: what decides how much lines and structure may move the cameras.
#pragma once

#include <cstddef>
#include <vector>

#include "holba/bundle/bundle_selection.h"
#include "holba/scene/reconstruction.h"
#include "holba/solver/solver.h"

namespace holba {

// The variable points and lines of a selection in folds, each of which is left out once. A fold is
// a number of regions in space: what is left out must not stand beside what stays in, for
// neighbours err alike (several keypoints at one corner, a shadow, a corner that two lines at
// different depths make). The tracks that are judged were not made from structure, and three images
// of the selection see them at least: two images fit a point of their own to nearly any cameras.
class HeldOutPoints {
 public:
  static constexpr size_t kNumFolds = 4;  // a quarter is left out
  static constexpr size_t kMinImages = 3;

  HeldOutPoints(const Reconstruction& model, const BundleSelection& selection);

  size_t NumJudged(size_t fold) const { return folds_[fold].judged.size(); }
  // The selection as the adjustment of a fold sees it.
  BundleSelection Without(size_t fold, BundleSelection selection) const;
  // Of each track of a fold at the cameras of a model: the Cauchy cost of its observations by the
  // squared scale (px), at the point that is best for these cameras. The model's own points are
  // where the search begins; they do not change.
  std::vector<double> PredictionCosts(size_t fold, const Reconstruction& model, double scale_px,
                                      int num_threads) const;

 private:
  struct Fold {
    std::vector<point3D_t> points, judged;
    std::vector<line3D_t> lines;
  };
  FlatIndex image_idx_;  // of the selection: other images say nothing of what it adjusts
  std::vector<Fold> folds_;
};

// Images of an index that see a point.
size_t NumImages(const std::vector<PointObservation>& track, const FlatIndex& image_idx);

BundleSelection WithoutPoints(BundleSelection selection, const std::vector<point3D_t>& ids);

// For an adjustment of a fold from near its optimum: at most so many steps, nearly Gauss-Newton's,
// as damping would only keep weak directions from arriving.
SolverOptions StepsFromNear(SolverOptions options, int num_iterations);

// A mean of differences and its standard error.
struct PairedMean {
  double mean = 0.0, standard_error = 0.0;
};
// Of a from b, in pairs. At least two.
PairedMean MeanDifference(const std::vector<double>& a, const std::vector<double>& b);

}  // namespace holba
