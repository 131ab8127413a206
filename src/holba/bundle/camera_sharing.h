// SPDX-License-Identifier: BSD-3-Clause
// One camera for photographs that are said to be of several, where points that the adjustment has
// not seen are predicted as well by one.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "holba/bundle/bundle_options.h"
#include "holba/bundle/held_out.h"
#include "holba/bundle/losses.h"
#include "holba/scene/reconstruction.h"
#include "holba/solver/solver.h"

namespace holba {

// Cameras of one lens model and size that were tried as one.
struct CameraSharingTrial {
  camera_t kept = kInvalidId32;  // the one of them that all are now, if they are
  std::string model, model_of_one;
  size_t num_cameras = 0;
  PairedMean difference;   // mean cost of the points left out, several cameras less one
  bool is_shared = false;  // they are one now
};

// COLMAP gives each photograph without EXIF a camera of its own, which leaves most of them weakly
// known. Adjusts the points of the model with all cameras of a lens model and a size (that are not
// in a rig with others) as one, and keeps that, poses and points included, unless several predict
// better by more than chance; principal points stay. Nothing where focal lengths or distortion are
// held. `sigmas`: the
// noise of points, if it is known. `log`: a sentence for each trial.
std::vector<CameraSharingTrial> ShareCameras(const BundleOptions& options,
                                             const SolverOptions& solver_options,
                                             const NoiseSigmas& sigmas,
                                             const std::function<void(const std::string&)>& log,
                                             Reconstruction* model);

}  // namespace holba
