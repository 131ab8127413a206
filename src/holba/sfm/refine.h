// SPDX-License-Identifier: BSD-3-Clause
// From a posed model of points to a holistic one: structure is built on the poses, then everything
// is adjusted in two stages, cameras with what is reliable first, the rest on the cameras after it
// (paper, appendix "Reliability-Aware Refinement"); associations are estimated anew after each.
#pragma once

#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "holba/bundle/adjust_bundle.h"
#include "holba/sfm/reliability.h"
#include "holba/sfm/structure.h"
#include "holba/solver/solver.h"

namespace holba {

struct RefineOptions {
  StructureOptions structure;
  ReliabilityOptions reliability;
  BundleOptions bundle;
  // Its num_threads counts for all steps, whatever the options of structure say.
  SolverOptions solver;
  // Poses and intrinsics stay as they are: the paper's refinement of geometry.
  bool fix_poses = false;
  // Of both stages; associations are estimated anew before the next.
  int num_rounds = 2;

  RefineOptions();
  void Describe(OptionTable* table) const;
};

struct RefineReport {
  // Points alone, before structure is built.
  BundleSummary points_alone;
  // Cameras that were tried as one, and lens models that were tried, where that is asked for.
  std::vector<CameraSharingTrial> shared_cameras;
  std::vector<CameraModelTrial> camera_models;
  // What adjusting principal points adds to the cost of points left out, where it was asked for;
  // they stay where that gains nothing.
  std::optional<PairedMean> principal_point;
  bool principal_point_held = false;
  StructureReport structure;
  // Of the last round, and what stage 1 was told.
  BundleSummary stage1, stage2;
  BundleOptions stage1_options;
  Reliability reliability;
  // Associations that the tests of all stages threw out, by kind.
  std::map<std::string, size_t> rejected;
  double structure_seconds = 0.0, adjust_seconds = 0.0;
};

// Matches segments on the poses that structure is built on.
using LineMatcher = std::function<LineMatchMap(const Reconstruction&)>;

// The model holds poses and points; what structure it has is replaced. `match_lines` and
// `observe_regions`, which may be empty, see the model in its local frame (local_frame.h). `log`: a
// sentence for each step.
RefineReport RefineModel(const RefineOptions& options, const ImageFeatureMap& features,
                         const LineMatcher& match_lines, const RegionObserver& observe_regions,
                         Reconstruction* model, const std::function<void(const std::string&)>& log);

}  // namespace holba
