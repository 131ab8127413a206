// SPDX-License-Identifier: BSD-3-Clause
// holba match: verified matches for a database of features.
#include <fmt/format.h>

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "apps/command.h"
#include "holba/base/log.h"
#include "holba/base/timer.h"
#include "holba/base/words.h"
#include "holba/pipeline/match_points.h"
#include "holba/pipeline/match_segments.h"
#include "holba/pipeline/pair_lists.h"

namespace holba {
namespace {

constexpr double kSecondsBetweenMessages = 5.0;

std::string ToText(const MatchPointsReport& report, const MatchSegmentsReport& segments) {
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

nlohmann::json ToJson(const MatchPointsReport& report, const MatchSegmentsReport& segments) {
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

class MatchJob : public Job {
 public:
  void Describe(OptionTable* table) const override {
    table
        ->Field("database_path", &database_path_, "COLMAP database with keypoints and descriptors.")
        .Required();
    pairs_.Describe(table);
    matching_.Describe(table);
    segments_.Describe(table);
  }

  void ProbeOutputs(const Invocation&) const override {
    ProbeExistingDatabase(database_path_);
    ProbeResult();
  }

  void Run(const Invocation& invocation) override {
    pairs_.Check();
    matching_.max_images_in_memory = 2 * pairs_.block_size;
    Database database(database_path_);
    const std::vector<ImagePair> pairs = ListPairs(pairs_, database, matching_.num_threads);
    LogInfo("{} of {}", Counted(pairs.size(), "pair"),
            Counted(database.ReadImages().size(), "image"));
    const Timer timer;
    double next_message = kSecondsBetweenMessages;
    const MatchPointsReport report = MatchPoints(matching_, pairs, &database, [&](size_t num_done) {
      const double seconds = timer.Seconds();
      if (seconds < next_message || num_done == pairs.size()) return;
      next_message = seconds + kSecondsBetweenMessages;
      const double rate = static_cast<double>(num_done) / seconds;
      LogInfo("{} of {}, {:.1f} a second, {:.0f} s left", num_done, Counted(pairs.size(), "pair"),
              rate, static_cast<double>(pairs.size() - num_done) / rate);
    });
    // By the points that were verified.
    MatchSegmentsReport segments;
    if (!matching_.skip_geometric_verification)
      segments = MatchSegmentsOfPairs(segments_, pairs, matching_.num_threads, &database);
    PrintResult(invocation.json ? ToJson(report, segments).dump(2) + "\n"
                                : ToText(report, segments));
  }

 private:
  std::string database_path_;
  PairListOptions pairs_;
  MatchPointsOptions matching_;
  LineMatchingOptions segments_ = {.num_near_points = kNearPointsWithoutPoses};
};

}  // namespace

Command MatchCommand() {
  return {.name = "match",
          .summary = "Match the features of a database's images and verify the matches",
          .details =
              "Takes keypoints and descriptors from a COLMAP database (of holba extract, COLMAP's "
              "feature_extractor, hloc, ...),\n"
              "and puts matches and two-view geometries into it, as COLMAP's matchers do. Pairs "
              "that are there already stay as\n"
              "they are: a run that was stopped goes on where it ended. Segments of holba are "
              "matched by the points around them. Options have the names "
              "that COLMAP 4 gives them.",
          .supports_json = true,
          .make_job = [] { return std::make_unique<MatchJob>(); }};
}

}  // namespace holba
