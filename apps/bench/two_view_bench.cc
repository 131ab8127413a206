// SPDX-License-Identifier: BSD-3-Clause
#include "apps/bench/two_view_bench.h"

#include <fmt/format.h>

#include <algorithm>
#include <ctime>
#include <string>
#include <utility>

#include "apps/bench/view_blocks.h"
#include "holba/estimation/two_view/relative_pose.h"

namespace holba {
namespace {

RelativePoseResult Estimate(const TwoViewOptions& options, const MatchedPair& pair, uint64_t seed) {
  RelativePoseResult result;
  const std::clock_t begin = std::clock();
  const MatchedRays rays(pair.camera, pair.pixels1, pair.camera, pair.pixels2);
  TwoViewRansacOptions ransac;
  ransac.max_error_px = options.max_error;
  ransac.confidence = options.confidence;
  ransac.max_num_samples = options.max_num_trials;
  ransac.min_inlier_ratio = options.min_inlier_ratio;
  ransac.seed = seed;
  if (const auto fit = FitTwoView(TwoViewKind::kEssential, rays, ransac)) {
    if (const auto pose = ChoosePose(PosesOfEssential(fit->model), rays, fit->inliers))
      result.cam2_from_cam1 = pose->cam2_from_cam1;
    result.num_inliers = fit->inliers.size();
    result.num_samples = fit->num_samples;
  }
  result.cpu_us = 1e6 * static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC;
  return result;
}

}  // namespace

std::vector<MatchedPair> ReadMatchedPairs(const std::filesystem::path& path) {
  std::vector<MatchedPair> pairs;
  for (ViewBlock& block : ReadViewBlocks(path, "pair", "X1 Y1 X2 Y2", "benchmark/two_view.py")) {
    MatchedPair& pair = pairs.emplace_back();
    pair.camera = std::move(block.camera);
    for (const std::vector<double>& row : block.rows) {
      pair.pixels1.emplace_back(row[0], row[1]);
      pair.pixels2.emplace_back(row[2], row[3]);
    }
  }
  return pairs;
}

std::vector<RelativePoseResult> EstimateRelativePoses(const TwoViewOptions& options,
                                                      const std::vector<MatchedPair>& pairs) {
  std::vector<RelativePoseResult> results;
  for (size_t i = 0; i < pairs.size(); ++i)
    results.push_back(Estimate(options, pairs[i], static_cast<uint64_t>(options.random_seed) + i));
  return results;
}

Table RelativePoseTable(const std::vector<RelativePoseResult>& results) {
  size_t num_poses = 0;
  std::vector<double> times_us;
  for (const RelativePoseResult& result : results) {
    num_poses += result.cam2_from_cam1.has_value();
    times_us.push_back(result.cpu_us);
  }
  std::sort(times_us.begin(), times_us.end());
  const double median_us = times_us.empty() ? 0.0 : times_us[times_us.size() / 2];
  return {.title = "",
          .header = {"pairs", "with a pose", "median us"},
          .rows = {{std::to_string(results.size()), std::to_string(num_poses),
                    fmt::format("{:.0f}", median_us)}}};
}

nlohmann::json RelativePosesToJson(const std::vector<RelativePoseResult>& results) {
  nlohmann::json json = nlohmann::json::array();
  for (const RelativePoseResult& result : results) {
    nlohmann::json entry = {{"inliers", result.num_inliers},
                            {"samples", result.num_samples},
                            {"cpu_us", result.cpu_us}};
    if (result.cam2_from_cam1) {
      const Eigen::Quaterniond& q = result.cam2_from_cam1->rotation;
      const Eigen::Vector3d& t = result.cam2_from_cam1->translation;
      entry["qvec"] = {q.w(), q.x(), q.y(), q.z()};
      entry["tvec"] = {t.x(), t.y(), t.z()};
    }
    json.push_back(std::move(entry));
  }
  return json;
}

}  // namespace holba
