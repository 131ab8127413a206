// SPDX-License-Identifier: BSD-3-Clause
#include "holba/bundle/camera_sharing.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <optional>
#include <set>
#include <tuple>
#include <utility>

#include "holba/base/words.h"
#include "holba/bundle/adjust_bundle.h"
#include "holba/bundle/camera_model_choice.h"
#include "holba/bundle/intrinsics_choice.h"
#include "holba/scene/merge_cameras.h"

namespace holba {
namespace {

// Lens model, width, height.
using Kind = std::tuple<int, uint64_t, uint64_t>;

// Cameras that registered images have, by kind; those of two and more.
std::map<Kind, std::set<camera_t>> CamerasByKind(const Reconstruction& model) {
  const std::set<camera_t> alone = CamerasOfTrivialRigs(model);
  std::map<Kind, std::set<camera_t>> kinds;
  for (const auto& [id, image] : model.images) {
    if (!alone.contains(image.camera_id)) continue;
    const Camera& camera = model.cameras.at(image.camera_id);
    kinds[{camera.model->id, camera.width, camera.height}].insert(image.camera_id);
  }
  std::erase_if(kinds, [](const auto& entry) { return entry.second.size() < 2; });
  return kinds;
}

// Parameter by parameter the median: single cameras may be far off.
std::vector<double> MedianParams(const Reconstruction& model, const std::set<camera_t>& cameras) {
  std::vector<double> params = model.cameras.at(*cameras.begin()).params;
  for (size_t i = 0; i < params.size(); ++i) {
    std::vector<double> values;
    for (const camera_t id : cameras) values.push_back(model.cameras.at(id).params[i]);
    std::nth_element(values.begin(), values.begin() + values.size() / 2, values.end());
    params[i] = values[values.size() / 2];
  }
  return params;
}

Reconstruction Shared(const Reconstruction& model, const std::set<camera_t>& cameras) {
  Reconstruction shared = model;
  const camera_t kept = *cameras.begin();
  shared.cameras.at(kept).params = MedianParams(model, cameras);
  MergeCameras(kept, cameras, &shared);
  return shared;
}

class Trial {
 public:
  Trial(const BundleOptions& options, const SolverOptions& solver_options,
        const std::function<void(const std::string&)>& log, const Reconstruction& adjusted,
        const NoiseSigmas& sigmas, const std::set<camera_t>& cameras)
      : options_(options),
        solver_options_(solver_options),
        log_(log),
        adjusted_(adjusted),
        sigmas_(sigmas),
        cameras_(cameras),
        shared_(Shared(adjusted, cameras)) {}

  // Several cameras may make up for what their lens model lacks. Then one of a richer model does
  // better than they; which one it shall have is another choice.
  CameraSharingTrial Run(bool may_be_richer) {
    sigmas_of_shared_ = Adjust(&shared_);
    CameraSharingTrial trial = Compare(shared_);
    const CameraModel* richer = RicherModel(*shared_.cameras.at(*cameras_.begin()).model);
    if (trial.is_shared || !may_be_richer || richer == nullptr) return trial;
    Reconstruction shared = shared_;
    if (!ConvertCameras({*cameras_.begin()}, *richer, &shared)) return trial;
    Adjust(&shared);
    return Compare(shared);
  }

  const Reconstruction& shared() const { return shared_; }
  const NoiseSigmas& sigmas_of_shared() const { return sigmas_of_shared_; }

 private:
  NoiseSigmas Adjust(Reconstruction* model) const {
    return AdjustBundle(options_, solver_options_, model).auto_sigmas;
  }

  CameraSharingTrial Compare(const Reconstruction& shared) const {
    const camera_t kept = *cameras_.begin();
    CameraSharingTrial trial{kept,
                             std::string(adjusted_.cameras.at(kept).model->name),
                             std::string(shared.cameras.at(kept).model->name),
                             cameras_.size(),
                             {},
                             false};
    trial.difference =
        ComparePredictions({options_, adjusted_}, {options_, shared}, sigmas_, solver_options_);
    trial.is_shared = trial.difference.mean >= -kMinGainErrors * trial.difference.standard_error;
    if (log_) {
      log_(fmt::format("Points left out cost {:+.4f} +- {:.4f} with {} in the place of one {}: {}",
                       trial.difference.mean, trial.difference.standard_error,
                       Counted(trial.num_cameras, trial.model + " camera"), trial.model_of_one,
                       trial.is_shared ? "they are one" : "they stay"));
    }
    return trial;
  }

  const BundleOptions& options_;
  const SolverOptions& solver_options_;
  const std::function<void(const std::string&)>& log_;
  const Reconstruction& adjusted_;
  const NoiseSigmas& sigmas_;
  const std::set<camera_t>& cameras_;
  Reconstruction shared_;
  NoiseSigmas sigmas_of_shared_;
};

}  // namespace

std::vector<CameraSharingTrial> ShareCameras(const BundleOptions& given,
                                             const SolverOptions& solver_options,
                                             const NoiseSigmas& sigmas,
                                             const std::function<void(const std::string&)>& log,
                                             Reconstruction* model) {
  std::vector<CameraSharingTrial> trials;
  std::optional<BundleOptions> options = PointsAlone(given);
  // A single photograph says nothing of its principal point: that would only serve to fit what is
  // wrong.
  if (options) options->refine_principal_point = false;
  if (!options || !given.refine_focal_length || !given.refine_extra_params) return trials;

  std::optional<Reconstruction> adjusted;
  NoiseSigmas known = sigmas;
  for (const auto& [kind, cameras] : CamerasByKind(*model)) {
    if (!adjusted) {
      adjusted = *model;
      known = AdjustBundle(*options, solver_options, &*adjusted, {}, {}, known).auto_sigmas;
    }
    Trial trial(*options, solver_options, log, *adjusted, known, cameras);
    trials.push_back(trial.Run(given.camera_model == CameraModelSource::kAuto));
    if (!trials.back().is_shared) continue;
    known = trial.sigmas_of_shared();
    adjusted = trial.shared();
    *model = *adjusted;
  }
  return trials;
}

}  // namespace holba
