// SPDX-License-Identifier: BSD-3-Clause
// The result of `holba localize` for people and for programs.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "holba/pipeline/localize.h"

namespace holba {

std::string LocalizeToText(const LocalizeReport& report);
nlohmann::json LocalizeToJson(const LocalizeReport& report);

}  // namespace holba
