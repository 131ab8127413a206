// SPDX-License-Identifier: BSD-3-Clause
#include "holba/pipeline/match_lines.h"

#include <fmt/format.h>

#include <optional>
#include <utility>
#include <vector>

#include "holba/base/progress.h"
#include "holba/base/threads.h"
#include "holba/base/timer.h"
#include "holba/base/words.h"
#include "holba/frontend/importers/import_line_matches.h"
#include "holba/pipeline/settings.h"
#include "holba/scene/views.h"

namespace holba {
namespace {

// Not so where a photograph is left out, whatever the database or other files have of it.
bool HaveSegments(const ImageFeatureMap& features, const ImagePair& pair) {
  return !features.at(pair.first).segments.empty() && !features.at(pair.second).segments.empty();
}

bool AreDescribed(const ImageFeatureMap& features, const ImagePair& pair) {
  return !features.at(pair.first).segment_descriptors.empty() &&
         !features.at(pair.second).segment_descriptors.empty();
}

void ImportMatches(const std::string& import_path, const Reconstruction& model,
                   const ImageFeatureMap& features, const std::map<image_t, image_t>& database_id,
                   const std::map<image_t, ImportedSegments>& imported, Database* database,
                   LineMatchMap* matches, MatchLinesReport* report) {
  LineMatchImportReport import_report;
  *matches = ImportLineMatches(import_path, model, imported, &import_report);
  for (const auto& [reason, count] : import_report.dropped) report->dropped[reason] += count;
  report->matches_imported = true;
  report->num_pairs = import_report.num_pairs;
  report->num_line_matches = import_report.num_matches;
  std::erase_if(*matches, [&](const auto& entry) {
    if (HaveSegments(features, entry.first)) return false;
    const size_t num_matches = entry.second.size();
    report->num_line_matches -= num_matches;
    report->dropped["match: of an image whose photograph is left out"] += num_matches;
    return true;
  });
  Database::Transaction transaction(database);
  for (const auto& [pair, list] : *matches) {
    database->WriteLineMatches(database_id.at(pair.first), database_id.at(pair.second), "imported",
                               list);
  }
  transaction.Commit();
}

struct LinePairTask {
  ImagePair pair;
  const std::vector<SharedPoint>* points;
  Eigen::Matrix3d F;
  std::string settings;
  std::vector<LineMatch> matches;
};

// All that the matches of a pair depend on but the segments: these are the stored ones (new ones
// remove their matches).
std::string SettingsOfPair(const std::string& matching, const Reconstruction& model,
                           const ImagePair& pair, const std::vector<SharedPoint>& points,
                           const Eigen::Matrix3d& F) {
  static_assert(sizeof(SharedPoint) == 4 * sizeof(double));
  const auto camera_of = [&](image_t id) {
    return ToString(model.cameras.at(model.images.at(id).camera_id));
  };
  return fmt::format("{} geometry={:016x} points={:016x} cameras={}, {}", matching,
                     HashBytes(F.data(), 9 * sizeof(double)),
                     HashBytes(points.data(), points.size() * sizeof(SharedPoint)),
                     camera_of(pair.first), camera_of(pair.second));
}

void MatchPairs(const MatchLinesOptions& options, const Reconstruction& model,
                const ImageFeatureMap& features, std::vector<LinePairTask>* tasks) {
  std::map<image_t, MatchableSegments> matchable;
  for (const LinePairTask& task : *tasks) {
    for (image_t id : {task.pair.first, task.pair.second}) {
      if (matchable.contains(id)) continue;
      matchable.emplace(
          id, MakeMatchable(features.at(id), model.cameras.at(model.images.at(id).camera_id)));
    }
  }
  Progress progress("Matching segments", "pairs", tasks->size());
  ParallelTasks(options.num_threads, tasks->size(), [&](size_t i) {
    LinePairTask& task = (*tasks)[i];
    const auto& [id1, id2] = task.pair;
    task.matches =
        MatchSegments(options.matching, matchable.at(id1), matchable.at(id2), *task.points, task.F);
    progress.Advance();
  });
}

}  // namespace

void MatchLinesOptions::Describe(OptionTable* table) const {
  matching.Describe(table);
  pairs.Describe(table);
}

LineMatchMap MatchLines(const MatchLinesOptions& options, const std::string& import_path,
                        const Reconstruction& model, const ImageFeatureMap& features,
                        const std::map<image_t, image_t>& database_id,
                        const std::map<image_t, ImportedSegments>& imported, Database* database,
                        MatchLinesReport* report) {
  const Timer timer;
  LineMatchMap matches;
  if (!import_path.empty()) {
    ImportMatches(import_path, model, features, database_id, imported, database, &matches, report);
    report->match_seconds = timer.Seconds();
    return matches;
  }

  const auto pairs = PairsWithSharedPoints(options.pairs, model);
  const std::string text = SettingsText("guided matching 2", options.matching);
  const ViewMap views(model);
  std::vector<LinePairTask> open;
  for (const auto& [pair, points] : pairs) {
    if (!HaveSegments(features, pair)) {
      matches.emplace(pair, std::vector<LineMatch>{});
      continue;
    }
    if (!AreDescribed(features, pair)) {
      matches.emplace(pair, StoredLineMatches(*database, database_id.at(pair.first),
                                              database_id.at(pair.second)));
      ++report->pairs_reused;
      continue;
    }
    const Eigen::Matrix3d F = FundamentalMatrix(views.at(pair.first), views.at(pair.second));
    std::string settings = SettingsOfPair(text, model, pair, points, F);
    auto stored = database->ReadLineMatches(database_id.at(pair.first), database_id.at(pair.second),
                                            settings);
    if (stored) {
      matches.emplace(pair, std::move(*stored));
      ++report->pairs_reused;
    } else {
      open.push_back({pair, &points, F, std::move(settings), {}});
    }
  }
  report->num_pairs = pairs.size();

  MatchPairs(options, model, features, &open);
  Database::Transaction transaction(database);
  for (LinePairTask& task : open) {
    database->WriteLineMatches(database_id.at(task.pair.first), database_id.at(task.pair.second),
                               task.settings, task.matches);
    matches.emplace(task.pair, std::move(task.matches));
  }
  transaction.Commit();
  for (const auto& [pair, list] : matches) report->num_line_matches += list.size();
  report->match_seconds = timer.Seconds();
  return matches;
}

std::vector<LineMatch> StoredLineMatches(const Database& database, image_t image_id1,
                                         image_t image_id2) {
  const auto settings = database.ReadLineMatchSettings(image_id1, image_id2);
  if (!settings) return {};
  return database.ReadLineMatches(image_id1, image_id2, *settings)
      .value_or(std::vector<LineMatch>());
}

std::string MatchingText(const MatchLinesReport& report) {
  const std::string origin =
      report.matches_imported ? "imported"
                              : fmt::format("{} matched now, {} in the database",
                                            Counted(report.num_pairs - report.pairs_reused, "pair"),
                                            report.pairs_reused);
  return fmt::format("{}: {} ({}), {:.1f} s", Counted(report.num_pairs, "image pair"),
                     Counted(report.num_line_matches, "segment match"), origin,
                     report.match_seconds);
}

}  // namespace holba
