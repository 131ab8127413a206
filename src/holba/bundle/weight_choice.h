// SPDX-License-Identifier: BSD-3-Clause
// How much lines and structure may move the cameras, decided by point tracks that the adjustment
// has not seen.
#pragma once

#include <cstddef>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "holba/bundle/association_gate.h"
#include "holba/bundle/bundle_options.h"
#include "holba/bundle/bundle_selection.h"
#include "holba/bundle/held_out.h"
#include "holba/bundle/losses.h"
#include "holba/scene/reconstruction.h"

namespace holba {

// What moves the cameras.
struct CameraWeights {
  // Neither lines nor structure; then `structure` says nothing.
  bool points_alone = false;
  StructureWeights structure;

  bool IsAsGiven() const { return !points_alone && structure == StructureWeights(); }
  bool operator==(const CameraWeights&) const = default;
  std::string Text() const;
};

// Cameras that were adjusted with these weights predict the tracks left out with this mean cost,
// less that of cameras of points alone, in the same tracks.
struct WeightTrial {
  CameraWeights weights;
  PairedMean from_points;
};

struct WeightChoice {
  CameraWeights weights;
  // UnverifiedPoints do not move the cameras.
  bool without_unverified = false;
  // Of points alone: what these add to the costs of cameras without them.
  PairedMean pairs_from_verified;
  std::vector<WeightTrial> trials;
  size_t num_tracks = 0;  // that were left out, in all folds

  // All that is selected moves the cameras, with the weights of the options.
  bool IsAsGiven() const { return weights.IsAsGiven() && !without_unverified; }
};

// Points of a selection that two of its images see, but for those that hold an image up: both
// images must have kMinVerified points that a third image sees.
std::vector<point3D_t> UnverifiedPoints(const Reconstruction& model,
                                        const BundleSelection& selection);

// What of a selection moves the cameras.
BundleSelection SelectionOfCameras(const Reconstruction& model, const WeightChoice& choice,
                                   const BundleSelection& selection);

// The part of an adjustment that the choice repeats on its folds.
struct FoldAdjustment {
  const BundleOptions& options;
  const BundleSelection& selection;
  std::span<const GroupMeasurement> measurements;
  const AssociationFilter& filter;
  double point_scale_px;  // of the loss of points
  int num_threads;
  AutoScales* scales;
  // At most so many steps. False: no time is left, or the caller stops.
  std::function<bool(int num_iterations, Problem*)> solve;
};

// Models of many images are judged by a part of them. The model must be near the optimum with all
// weights as given; it comes back as it was. Weights stay as given where too few tracks could be
// left out, or `solve` said false.
WeightChoice ChooseWeights(const FoldAdjustment& adjustment, Reconstruction* model);

}  // namespace holba
