// SPDX-License-Identifier: BSD-3-Clause
// What `holba refine` did, as a JSON object and as text: what was found, what was refused and why,
// how long it took.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "holba/estimation/lines/line_leave_one_out.h"
#include "holba/pipeline/detection.h"
#include "holba/pipeline/match_lines.h"
#include "holba/pipeline/regions.h"
#include "holba/sfm/refine.h"

namespace holba {

struct RefineOutput {
  DetectionReport detection;
  MatchLinesReport matching;
  RegionReport regions;
  RefineReport refine;
  LeaveOneOutReport leave_one_out;
  double write_seconds = 0.0, total_seconds = 0.0;
};

nlohmann::json RefineToJson(const RefineOutput& output, const Reconstruction& model);
std::string RefineToText(const RefineOutput& output, const Reconstruction& model);

}  // namespace holba
