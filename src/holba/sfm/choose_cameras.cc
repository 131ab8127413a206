// SPDX-License-Identifier: BSD-3-Clause
#include "holba/sfm/choose_cameras.h"

#include <algorithm>
#include <set>
#include <utility>
#include <vector>

#include "holba/base/log.h"
#include "holba/bundle/camera_model_choice.h"
#include "holba/bundle/camera_sharing.h"
#include "holba/scene/merge_cameras.h"
#include "holba/sfm/filter_model.h"

namespace holba {
namespace {

// Cameras that only images without a pose have, and that were given as `kept` was.
std::set<camera_t> SameAsGiven(const MapperState& state, const Reconstruction& model,
                               camera_t kept) {
  const Reconstruction& before = state.model();
  const Camera& of_kept = before.cameras.at(kept);
  const std::vector<double>& given = state.given_params.at(kept);
  std::set<camera_t> same;
  for (const camera_t id : CamerasOfTrivialRigs(model)) {
    if (id == kept || state.NumRegistered(id) > 0) continue;
    const Camera& camera = model.cameras.at(id);
    if (camera.model == of_kept.model && camera.width == of_kept.width &&
        camera.height == of_kept.height && state.given_params.at(id) == given)
      same.insert(id);
  }
  return same;
}

}  // namespace

bool ChooseCameras(const MapperOptions& options, const SolverOptions& solver, MapperState* state) {
  if (!state->existing_frames.empty()) return false;
  BundleOptions bundle = options.cameras;
  bundle.refine_focal_length &= options.global.refine_focal_length;
  bundle.refine_extra_params &= options.global.refine_extra_params;
  bundle.RememberPrincipalPoints(state->model());

  const auto log = [](const std::string& sentence) { LogDebug("{}", sentence); };
  Reconstruction model = state->model();
  bool changed = false;
  if (bundle.share_cameras) {
    for (const CameraSharingTrial& trial : ShareCameras(bundle, solver, {}, log, &model)) {
      if (!trial.is_shared) continue;
      changed = true;
      MergeCameras(trial.kept, SameAsGiven(*state, model, trial.kept), &model);
    }
  }
  // The filter would take the poses of all images of a camera that is not.
  const CameraCondition is_plausible = [&](const Camera& camera) {
    return IsPlausible(options.filter, camera);
  };
  if (bundle.camera_model == CameraModelSource::kAuto) {
    const auto trials = ChooseCameraModels(bundle, solver, {}, log, &model, is_plausible);
    changed |= std::any_of(trials.begin(), trials.end(),
                           [](const CameraModelTrial& trial) { return trial.taken; });
  }
  if (!changed) return false;
  // Lenses are judged with principal points that move; mapping holds them where they were given.
  if (!options.global.refine_principal_point) bundle.RestorePrincipalPoints(&model);
  if (!std::all_of(model.images.begin(), model.images.end(), [&](const auto& entry) {
        return is_plausible(model.cameras.at(entry.second.camera_id));
      }))
    return false;
  state->TakeCameras(std::move(model));
  return true;
}

}  // namespace holba
