// SPDX-License-Identifier: BSD-3-Clause
// A richer lens model where points that the adjustment has not seen are predicted better with it.
#pragma once

#include <functional>
#include <set>
#include <string>
#include <vector>

#include "holba/bundle/bundle_options.h"
#include "holba/bundle/held_out.h"
#include "holba/bundle/losses.h"
#include "holba/scene/reconstruction.h"
#include "holba/solver/solver.h"

namespace holba {

// The lens model that is tried first in the place of another. Null: none is.
const CameraModel* RicherModel(const CameraModel& model);

// Cameras in another lens model, where they see what they saw. False: that has none for one of them
// (the model is partly changed then).
bool ConvertCameras(const std::set<camera_t>& ids, const CameraModel& to, Reconstruction* model);

using CameraCondition = std::function<bool(const Camera&)>;

// One model tried in the place of another for all cameras of that.
struct CameraModelTrial {
  std::string from, to;
  size_t num_cameras = 0;
  PairedMean difference;  // mean cost of the points left out, richer less simpler
  // Alike with the cameras of the other half of the images (CompareCarried); only where points left
  // out say richer.
  PairedMean carried;
  bool taken = false;  // the richer one
};

// Adjusts the points of the model with its cameras in richer lens models (OPENCV; where that
// predicts better, also RADIAL, FULL_OPENCV and OPENCV_FISHEYE) and keeps the simplest that no
// richer one surpasses by more than chance. Cameras whose focal length or distortion is held stay,
// as do those of models without a richer one here. The model is changed only where a richer one is
// taken: then it is that adjustment's points, poses and cameras. `sigmas`: the noise of points, if
// it is known. `log`: a sentence for each trial. `is_usable`: what a camera of a richer model must
// be for the model to be tried against others; none: any camera is.
std::vector<CameraModelTrial> ChooseCameraModels(const BundleOptions& options,
                                                 const SolverOptions& solver_options,
                                                 const NoiseSigmas& sigmas,
                                                 const std::function<void(const std::string&)>& log,
                                                 Reconstruction* model,
                                                 const CameraCondition& is_usable = {});

}  // namespace holba
