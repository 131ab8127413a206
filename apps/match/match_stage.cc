// SPDX-License-Identifier: BSD-3-Clause
#include "apps/match/match_stage.h"

#include <fmt/format.h>

#include <vector>

#include "holba/base/log.h"
#include "holba/base/progress.h"
#include "holba/base/words.h"
#include "holba/io/database.h"

namespace holba {

std::string MatchToText(const MatchOutput& output) {
  const auto& [report, segments] = output;
  std::string text =
      fmt::format("{}, {} of them matched before; {} verified with {} of {}; {:.1f} s\n",
                  Counted(report.num_pairs, "pair"), report.pairs_reused, report.num_verified,
                  report.num_inliers, Counted(report.num_matches, "match"), report.seconds);
  for (const auto& [config, count] : report.num_of_config)
    text += fmt::format("  {}: {}\n", config, count);
  for (const auto& [reason, count] : report.dropped)
    text += fmt::format("  not verified, {}: {}\n", reason, count);
  for (const std::string& name : report.without_features)
    text += fmt::format("  without features: {}\n", name);
  if (segments.num_pairs > 0) {
    text += fmt::format("  segments of {}: {}, {} of them mutual nearest ones\n",
                        Counted(segments.num_pairs, "pair"), Counted(segments.num_matches, "match"),
                        segments.num_mutual);
  }
  return text;
}

nlohmann::json MatchToJson(const MatchOutput& output) {
  const auto& [report, segments] = output;
  nlohmann::json pairs = nlohmann::json::array();
  for (const MatchedPairReport& pair : report.pairs) {
    pairs.push_back({{"image_id1", pair.pair.first},
                     {"image_id2", pair.pair.second},
                     {"config", NameOf(pair.config)},
                     {"matches", pair.num_matches},
                     {"inliers", pair.num_inliers},
                     {"median_angle_deg", pair.median_angle_deg}});
  }
  return {{"pairs", report.num_pairs},
          {"pairs_reused", report.pairs_reused},
          {"verified", report.num_verified},
          {"matches", report.num_matches},
          {"inliers", report.num_inliers},
          {"configs", report.num_of_config},
          {"not_verified", report.dropped},
          {"without_features", report.without_features},
          {"segments",
           {{"pairs", segments.num_pairs},
            {"pairs_reused", segments.pairs_reused},
            {"matches", segments.num_matches},
            {"mutual", segments.num_mutual},
            {"seconds", segments.seconds}}},
          {"seconds",
           {{"total", report.seconds},
            {"match_cpu", report.match_cpu_seconds},
            {"verify_cpu", report.verify_cpu_seconds}}},
          {"verified_pairs", std::move(pairs)}};
}

MatchOutput RunMatch(const MatchStageOptions& options, const std::filesystem::path& database_path) {
  options.pairs.Check();
  MatchPointsOptions matching = options.matching;
  matching.max_images_in_memory = 2 * options.pairs.block_size;
  Database database(database_path);
  const std::vector<ImagePair> pairs = ListPairs(options.pairs, database, matching.num_threads);
  LogInfo("{} of {}", Counted(pairs.size(), "pair"),
          Counted(database.ReadImages().size(), "image"));
  MatchOutput output;
  {
    Progress progress("Matching", "pairs", pairs.size());
    output.points = MatchPoints(matching, pairs, &database,
                                [&](size_t num_done) { progress.Update(num_done); });
  }
  // By the points that were verified.
  if (!matching.skip_geometric_verification) {
    output.segments =
        MatchSegmentsOfPairs(options.segments, pairs, matching.num_threads, &database);
  }
  return output;
}

}  // namespace holba
