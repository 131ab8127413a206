// SPDX-License-Identifier: BSD-3-Clause
// Which cameras became one, and which lens models were taken, for reports.
#pragma once

#include <nlohmann/json.hpp>
#include <span>
#include <string>

#include "holba/bundle/camera_model_choice.h"
#include "holba/bundle/camera_sharing.h"

namespace holba {

// [{"cameras": 30, "model": "SIMPLE_RADIAL", "model_of_one": "OPENCV", "cost_if_several": C,
// "standard_error": E, "shared": true}, ...].
nlohmann::json SharedCamerasToJson(std::span<const CameraSharingTrial> trials);
// [{"cameras": 1, "from": "SIMPLE_RADIAL", "to": "OPENCV", "cost_of_richer": C, "standard_error":
// E, "taken": false}, ...].
nlohmann::json CameraModelsToJson(std::span<const CameraModelTrial> trials);

// A line for each change, and none where nothing changed.
std::string CameraChoicesToText(std::span<const CameraSharingTrial> sharing,
                                std::span<const CameraModelTrial> models);

}  // namespace holba
