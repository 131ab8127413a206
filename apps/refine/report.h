// SPDX-License-Identifier: BSD-3-Clause
// What `holba refine` did, as a JSON object and as text: what was found, what was refused and why,
// how long it took.
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

#include "apps/refine/detection.h"
#include "apps/refine/regions.h"
#include "holba/estimation/lines/line_leave_one_out.h"
#include "holba/sfm/refine.h"

namespace holba {

struct RefineOutput {
  DetectionReport detection;
  RegionReport regions;
  RefineReport refine;
  LeaveOneOutReport leave_one_out;
  double write_seconds = 0.0, total_seconds = 0.0;
};

nlohmann::json RefineToJson(const RefineOutput& output, const Reconstruction& model);
std::string RefineToText(const RefineOutput& output, const Reconstruction& model);

// One line each, for the log.
std::string DetectionText(const DetectionReport& report, const std::filesystem::path& database);
std::string MatchingText(const DetectionReport& report);

}  // namespace holba
