// SPDX-License-Identifier: BSD-3-Clause
#include "apps/camera_choices.h"

#include <fmt/format.h>

#include "holba/base/words.h"

namespace holba {

using nlohmann::json;

json SharedCamerasToJson(std::span<const CameraSharingTrial> trials) {
  json all = json::array();
  for (const CameraSharingTrial& trial : trials) {
    all.push_back({{"cameras", trial.num_cameras},
                   {"model", trial.model},
                   {"model_of_one", trial.model_of_one},
                   {"cost_if_several", trial.difference.mean},
                   {"standard_error", trial.difference.standard_error},
                   {"shared", trial.is_shared}});
  }
  return all;
}

json CameraModelsToJson(std::span<const CameraModelTrial> trials) {
  json all = json::array();
  for (const CameraModelTrial& trial : trials) {
    all.push_back({{"cameras", trial.num_cameras},
                   {"from", trial.from},
                   {"to", trial.to},
                   {"cost_of_richer", trial.difference.mean},
                   {"standard_error", trial.difference.standard_error},
                   {"taken", trial.taken}});
    if (!(trial.carried.standard_error > 0.0)) continue;  // not measured
    all.back()["cost_of_richer_carried"] = trial.carried.mean;
    all.back()["standard_error_carried"] = trial.carried.standard_error;
  }
  return all;
}

std::string CameraChoicesToText(std::span<const CameraSharingTrial> sharing,
                                std::span<const CameraModelTrial> models) {
  std::string text;
  for (const CameraSharingTrial& trial : sharing) {
    if (!trial.is_shared) continue;
    text += fmt::format("{} became one: several predict points left out by {:+.4f} +- {:.4f}\n",
                        Counted(trial.num_cameras, trial.model + " camera"), trial.difference.mean,
                        trial.difference.standard_error);
  }
  for (const CameraModelTrial& trial : models) {
    if (!trial.taken) continue;
    text += fmt::format("{} {} rather than {}: points left out cost {:+.4f} +- {:.4f}\n",
                        Counted(trial.num_cameras, "camera"), trial.to, trial.from,
                        trial.difference.mean, trial.difference.standard_error);
  }
  return text;
}

}  // namespace holba
