// SPDX-License-Identifier: BSD-3-Clause
// Matches of a database's points and segments, with what is said of them, for the commands match
// and reconstruct.
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

#include "holba/base/options.h"
#include "holba/frontend/matching/line_matching.h"
#include "holba/pipeline/match_points.h"
#include "holba/pipeline/match_segments.h"
#include "holba/pipeline/pair_lists.h"

namespace holba {

struct MatchStageOptions {
  PairListOptions pairs;
  MatchPointsOptions matching;
  LineMatchingOptions segments = {.num_near_points = kNearPointsWithoutPoses};
};

struct MatchOutput {
  MatchPointsReport points;
  MatchSegmentsReport segments;
};

// Throws InputError.
MatchOutput RunMatch(const MatchStageOptions& options, const std::filesystem::path& database_path);

nlohmann::json MatchToJson(const MatchOutput& output);
std::string MatchToText(const MatchOutput& output);

}  // namespace holba
