// SPDX-License-Identifier: BSD-3-Clause
// Holistic bundle adjustment of a model.
#pragma once

#include <functional>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "holba/bundle/association_gate.h"
#include "holba/bundle/bundle_options.h"
#include "holba/bundle/bundle_selection.h"
#include "holba/bundle/camera_model_choice.h"
#include "holba/bundle/camera_sharing.h"
#include "holba/bundle/losses.h"
#include "holba/bundle/weight_choice.h"
#include "holba/scene/local_frame.h"
#include "holba/scene/reconstruction.h"
#include "holba/solver/solver.h"

namespace holba {

struct BundleSummary {
  // Of the whole adjustment: times and iterations are sums over rounds; initial and final costs are
  // both taken with the losses of the last round, so that they compare.
  SolverSummary solver;
  // Scale of the loss of each term where it was `auto`, after the last round, and the robust
  // standard deviation of its residuals then; in the unit of the term: px, or the sine of an angle.
  std::map<std::string, double> auto_scales;
  NoiseSigmas auto_sigmas;
  int rounds = 0;  // of solving
  // What the gate found in its last round; empty if there was nothing to test or it was off.
  std::map<std::string, AssociationCount> associations;
  size_t groups_dropped = 0;
  AssociationFilter filter;  // which those were
  // What moved the cameras, and on what evidence.
  WeightChoice weight_choice;
  // Points and lines that fewer than two images see: they took no part and followed their images.
  size_t points_seen_once = 0, lines_seen_once = 0;
  std::vector<HeldIntrinsics> held_intrinsics;
  std::vector<CameraSharingTrial> shared_cameras;
  std::vector<CameraModelTrial> camera_models;  // that were tried
  size_t num_sensors = 0;                       // whose poses in their rigs were adjusted
  std::vector<HeldSensor> held_sensors;
  size_t num_parts = 1;  // that share no point, line or group
  // On the weights of terms in angles: the variance of the measured noise in pixels.
  double angular_weight_factor = 1.0;
  // The weights of structure_point residuals were multiplied by this.
  double structure_point_weight_factor = 1.0;
};

// Called at the start of each round with a sentence about it, for logs.
using RoundLog = std::function<void(const std::string&)>;

// Adjusts the model in place. With structure in the configuration and options.gate: first points
// and lines alone, then rounds of testing the associations and adjusting all of it with those that
// passed (membership in the model does not change). Losses `auto` are annealed: rounds of Cauchy
// whose scale halves down to options.auto_num_sigmas robust standard deviations, measured anew
// after every round; the last round runs to convergence. All of it in a frame of the scene
// (local_frame.h): neither the place of the origin nor the unit of length matters. `known`:
// BundleSummary::auto_sigmas of an earlier adjustment of these features, whose terms need no
// annealing. The model must be consistent.
BundleSummary AdjustBundle(const BundleOptions& options, const SolverOptions& solver_options,
                           Reconstruction* model,
                           std::span<const GroupMeasurement> measurements = {},
                           const RoundLog& log = {}, const NoiseSigmas& known = {});
// A part of the model: the rest stays as it is and has no say.
BundleSummary AdjustBundle(const BundleOptions& options, const SolverOptions& solver_options,
                           const BundleSelection& selection, Reconstruction* model,
                           std::span<const GroupMeasurement> measurements = {},
                           const RoundLog& log = {}, const NoiseSigmas& known = {});

// The frame that a model is adjusted in has a unit of its own, but for the 3D forms, whose costs
// are in the units of the model.
LocalFrame::Unit FrameUnit(const BundleOptions& options);

// Number of residuals and sum of squares of every term of FORMAT.md at the model as it stands (all
// eight, also the empty ones), then those of measurements if given.
std::vector<TermCost> EvaluateModel(const Reconstruction& model,
                                    std::span<const GroupMeasurement> measurements = {});

}  // namespace holba
