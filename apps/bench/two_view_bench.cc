// SPDX-License-Identifier: BSD-3-Clause
#include "apps/bench/two_view_bench.h"

#include <fmt/format.h>

#include <algorithm>
#include <ctime>
#include <sstream>
#include <string>

#include "holba/base/error.h"
#include "holba/base/file_faults.h"
#include "holba/base/words.h"
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
  std::istringstream file(ReadFileBytes(path));
  std::vector<MatchedPair> pairs;
  size_t num_open = 0;
  std::string text;
  uint64_t line = 1;
  for (; std::getline(file, text); ++line) {
    std::istringstream words(text);
    if (num_open > 0) {
      Eigen::Vector2d x1, x2;
      if (!(words >> x1.x() >> x1.y() >> x2.x() >> x2.y()))
        throw InputError::AtLine(path, line, "expected X1 Y1 X2 Y2");
      pairs.back().pixels1.push_back(x1);
      pairs.back().pixels2.push_back(x2);
      --num_open;
      continue;
    }
    std::string kind;
    if (!(words >> kind)) continue;
    MatchedPair pair;
    pair.camera.model = FindCameraModel("PINHOLE");
    pair.camera.params.resize(4);
    double* p = pair.camera.params.data();
    if (kind != "pair" || !(words >> pair.camera.width >> pair.camera.height >> p[0] >> p[1] >>
                            p[2] >> p[3] >> num_open)) {
      throw InputError::AtLine(path, line, "expected pair WIDTH HEIGHT FX FY CX CY NUM_MATCHES");
    }
    pairs.push_back(std::move(pair));
  }
  if (num_open > 0)
    throw InputError::AtLine(
        path, line,
        fmt::format("expected {} more, found the end of the file", Counted(num_open, "match")));
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
