// SPDX-License-Identifier: BSD-3-Clause
// The benchmark `two_view`: relative poses of pairs of views from matches of which many are wrong.
// benchmark/two_view.py makes the pairs, gives them to other programs too, and judges the poses.
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <vector>

#include "apps/bench/table.h"
#include "holba/estimation/two_view/two_view_estimation.h"

namespace holba {

// Two images of one pinhole camera. As text, one after the other:
//   pair WIDTH HEIGHT FX FY CX CY NUM_MATCHES
//   X1 Y1 X2 Y2                    as many lines
struct MatchedPair {
  Camera camera;
  std::vector<Eigen::Vector2d> pixels1, pixels2;
};

// Throws InputError with file and line.
std::vector<MatchedPair> ReadMatchedPairs(const std::filesystem::path& path);

struct RelativePoseResult {
  std::optional<Rigid3d> cam2_from_cam1;
  size_t num_inliers = 0;
  int num_samples = 0;
  double cpu_us = 0.0;
};

// The essential matrix alone, and the pose in it.
std::vector<RelativePoseResult> EstimateRelativePoses(const TwoViewOptions& options,
                                                      const std::vector<MatchedPair>& pairs);

Table RelativePoseTable(const std::vector<RelativePoseResult>& results);
nlohmann::json RelativePosesToJson(const std::vector<RelativePoseResult>& results);

}  // namespace holba
