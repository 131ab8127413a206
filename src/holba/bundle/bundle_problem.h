// SPDX-License-Identifier: BSD-3-Clause
// The bridge between scene and problem: a Reconstruction becomes a Problem once, and takes its
// values back.
#pragma once

#include <memory>
#include <set>
#include <span>
#include <utility>
#include <vector>

#include "holba/bundle/association_gate.h"
#include "holba/bundle/bundle_options.h"
#include "holba/bundle/bundle_selection.h"
#include "holba/problem/problem.h"
#include "holba/residual/view.h"
#include "holba/scene/reconstruction.h"

namespace holba {

struct SensorOfRig {
  rig_t rig_id;
  camera_t camera_id;
};

struct BundleProblem {
  Problem problem;
  // Which block holds what.
  std::vector<std::pair<frame_t, BlockId>> poses;
  std::vector<std::pair<camera_t, BlockId>> cameras;
  std::vector<std::pair<point3D_t, BlockId>> points;
  size_t num_points_of_structure = 0;  // among the points (IsOfStructure)
  std::vector<std::pair<line3D_t, BlockId>> lines;
  std::vector<std::pair<group3D_t, BlockId>> groups;
  // Poses of sensors in their rigs that are adjusted.
  std::vector<std::pair<SensorOfRig, BlockId>> sensors;
  // Those that are held: residuals point to them.
  std::vector<std::unique_ptr<SensorPose>> sensor_poses;
};

// All residuals of the selection and the configuration. The selection says what is held; the
// options say which intrinsics move, weights, losses and forms. Losses `auto` start as Cauchy at
// the settings' scale; AdjustBundle moves them. Blocks and their order depend on model, selection
// and options only, not on the filter of associations (null: all take part). Costs what the
// selection costs, however large the model is. The model must be consistent
// (Reconstruction::FindInconsistency) and outlive the problem.
BundleProblem BuildProblem(const Reconstruction& model, const BundleOptions& options,
                           const BundleSelection& selection,
                           std::span<const GroupMeasurement> measurements = {},
                           const AssociationFilter* filter = nullptr);
// Of BundleSelection::Everything.
BundleProblem BuildProblem(const Reconstruction& model, const BundleOptions& options,
                           std::span<const GroupMeasurement> measurements = {},
                           const AssociationFilter* filter = nullptr);

// Values of all variable blocks into the model; what was constant keeps its bits. With the pose of
// a sensor all frames of its rig move their images, also those that took no part. End points of
// lines are carried along to the new lines.
void WriteBack(const BundleProblem& bundle, Reconstruction* model);

// Mean reprojection errors of points, and of lines the mean over segments of the root mean square
// end point distance; over all observations, also those that took no part.
void UpdateErrors(Reconstruction* model);
// Of the points and lines of a selection.
void UpdateErrors(const BundleSelection& selection, Reconstruction* model);

}  // namespace holba
