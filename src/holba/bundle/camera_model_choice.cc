// SPDX-License-Identifier: BSD-3-Clause
#include "holba/bundle/camera_model_choice.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <optional>
#include <set>
#include <string_view>
#include <utility>

#include "holba/base/words.h"
#include "holba/bundle/adjust_bundle.h"
#include "holba/bundle/intrinsics_choice.h"
#include "holba/camera/convert_camera.h"

namespace holba {
namespace {

// What is tried for a model: first one that has all that lenses usually have. Only where this gains
// is its shape doubted; then one between the two may do, or others fit better.
struct Ladder {
  std::string_view from, richer, between;
  std::array<std::string_view, 2> others;
};
constexpr Ladder kLadders[] = {
    {"SIMPLE_PINHOLE", "OPENCV", "RADIAL", {"OPENCV_FISHEYE", "FULL_OPENCV"}},
    {"PINHOLE", "OPENCV", "", {"OPENCV_FISHEYE", "FULL_OPENCV"}},
    {"SIMPLE_RADIAL", "OPENCV", "RADIAL", {"OPENCV_FISHEYE", "FULL_OPENCV"}},
    {"RADIAL", "OPENCV", "", {"OPENCV_FISHEYE", "FULL_OPENCV"}},
    {"OPENCV", "FULL_OPENCV", "", {}},
    {"SIMPLE_FISHEYE", "OPENCV_FISHEYE", "", {}},
    {"SIMPLE_RADIAL_FISHEYE", "OPENCV_FISHEYE", "RADIAL_FISHEYE", {}},
    {"RADIAL_FISHEYE", "OPENCV_FISHEYE", "", {}},
};

// The choice for all cameras of one model.
class Choice {
 public:
  Choice(const BundleOptions& options, const SolverOptions& solver_options,
         const std::function<void(const std::string&)>& log, const CameraCondition& is_usable,
         const Ladder& ladder)
      : options_(options),
        solver_options_(solver_options),
        log_(log),
        is_usable_(is_usable),
        ladder_(ladder) {}

  // Of a model that is adjusted; so is what is returned, if anything is.
  std::optional<Reconstruction> Run(const Reconstruction& adjusted, const NoiseSigmas& sigmas) {
    cameras_.clear();
    for (const auto& [id, camera] : adjusted.cameras)
      if (camera.model->name == ladder_.from) cameras_.insert(id);
    if (cameras_.empty()) return std::nullopt;

    std::optional<Fitted> best = Try(Fitted{adjusted, sigmas}, ladder_.from, ladder_.richer);
    if (!best) return std::nullopt;
    std::string_view name = ladder_.richer;
    if (!ladder_.between.empty()) {
      if (auto simpler = Adjusted(best->model, ladder_.between)) {
        if (!Surpasses(*best, *simpler, ladder_.between, name)) {
          best = std::move(simpler);
          name = ladder_.between;
        }
      }
    }
    for (const std::string_view other : ladder_.others) {
      if (other.empty()) continue;
      if (auto better = Try(*best, name, other)) {
        best = std::move(better);
        name = other;
      }
    }
    return std::move(best->model);
  }

  std::vector<CameraModelTrial> trials;

 private:
  struct Fitted {
    Reconstruction model;
    NoiseSigmas sigmas;
  };

  // With the cameras of the choice in another model. Empty: no camera of it sees what these see, or
  // what they become is not usable.
  std::optional<Fitted> Adjusted(const Reconstruction& start, std::string_view name) const {
    const CameraModel& to = *FindCameraModel(name);
    Fitted fitted{start, {}};
    if (!ConvertCameras(cameras_, to, &fitted.model)) return std::nullopt;
    fitted.sigmas = AdjustBundle(options_, solver_options_, &fitted.model).auto_sigmas;
    if (is_usable_ && !std::all_of(cameras_.begin(), cameras_.end(), [&](camera_t id) {
          return is_usable_(fitted.model.cameras.at(id));
        }))
      return std::nullopt;
    return fitted;
  }

  // With `to` in the place of `from`, if that predicts better.
  std::optional<Fitted> Try(const Fitted& now, std::string_view from, std::string_view to) {
    auto fitted = Adjusted(now.model, to);
    if (!fitted || !Surpasses(*fitted, now, from, to)) return std::nullopt;
    return fitted;
  }

  bool Surpasses(const Fitted& richer, const Fitted& simpler, std::string_view from,
                 std::string_view to) {
    CameraModelTrial trial{std::string(from), std::string(to), cameras_.size(), {}, false};
    trial.difference = ComparePredictions({options_, richer.model}, {options_, simpler.model},
                                          simpler.sigmas, solver_options_);
    std::string words =
        fmt::format("Points left out cost {:+.4f} +- {:.4f} with {} in the place of {} for {}",
                    trial.difference.mean, trial.difference.standard_error, trial.to, trial.from,
                    Counted(trial.num_cameras, "camera"));
    const auto is_gain = [](const PairedMean& difference) {
      return difference.mean < -kMinGainErrors * difference.standard_error;
    };
    if (is_gain(trial.difference)) {
      trial.carried = CompareCarried({options_, richer.model}, {options_, simpler.model},
                                     simpler.sigmas, solver_options_);
      trial.taken = is_gain(trial.carried);
      words += fmt::format(", {:+.4f} +- {:.4f} with that of other images", trial.carried.mean,
                           trial.carried.standard_error);
    }
    if (log_) log_(words);
    trials.push_back(trial);
    return trial.taken;
  }

  const BundleOptions& options_;
  const SolverOptions& solver_options_;
  const std::function<void(const std::string&)>& log_;
  const CameraCondition& is_usable_;
  const Ladder& ladder_;
  std::set<camera_t> cameras_;
};

}  // namespace

const CameraModel* RicherModel(const CameraModel& model) {
  for (const Ladder& ladder : kLadders)
    if (ladder.from == model.name) return FindCameraModel(ladder.richer);
  return nullptr;
}

bool ConvertCameras(const std::set<camera_t>& ids, const CameraModel& to, Reconstruction* model) {
  for (const camera_t id : ids) {
    Camera& camera = model->cameras.at(id);
    auto params = ConvertCamera(*camera.model, camera.params, static_cast<double>(camera.width),
                                static_cast<double>(camera.height), to);
    if (!params) return false;
    camera.params = std::move(*params);
    camera.model = &to;
  }
  return true;
}

std::vector<CameraModelTrial> ChooseCameraModels(const BundleOptions& given,
                                                 const SolverOptions& solver_options,
                                                 const NoiseSigmas& sigmas,
                                                 const std::function<void(const std::string&)>& log,
                                                 Reconstruction* model,
                                                 const CameraCondition& is_usable) {
  std::vector<CameraModelTrial> trials;
  if (!given.refine_focal_length || !given.refine_extra_params) return trials;
  const std::optional<BundleOptions> points_alone = PointsAlone(given);
  if (!points_alone) return trials;
  const BundleOptions& options = *points_alone;

  std::optional<Reconstruction> adjusted;
  NoiseSigmas known = sigmas;
  for (const Ladder& ladder : kLadders) {
    const bool has_cameras =
        std::any_of(model->cameras.begin(), model->cameras.end(),
                    [&](const auto& entry) { return entry.second.model->name == ladder.from; });
    if (!has_cameras) continue;
    if (!adjusted) {
      adjusted = *model;
      known = AdjustBundle(options, solver_options, &*adjusted, {}, {}, known).auto_sigmas;
    }
    Choice choice(options, solver_options, log, is_usable, ladder);
    if (auto better = choice.Run(*adjusted, known)) {
      adjusted = *better;
      *model = std::move(*better);
    }
    trials.insert(trials.end(), choice.trials.begin(), choice.trials.end());
  }
  return trials;
}

}  // namespace holba
