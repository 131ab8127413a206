// SPDX-License-Identifier: BSD-3-Clause
// What `holba extract` found: text for people, JSON for programs.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "holba/pipeline/extract.h"

namespace holba {

std::string ExtractToText(const ExtractReport& report);
nlohmann::json ExtractToJson(const ExtractReport& report);

}  // namespace holba
