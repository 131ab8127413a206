// SPDX-License-Identifier: BSD-3-Clause
#include "holba/frontend/importers/import_line_matches.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <tuple>

#include "holba/base/error.h"
#include "holba/base/file_faults.h"
#include "holba/base/log.h"
#include "holba/frontend/importers/import_names.h"
#include "holba/frontend/importers/import_store.h"
#include "holba/frontend/importers/import_text.h"

namespace holba {
namespace fs = std::filesystem;
namespace {

// One index for each segment of the first image, -1: none; or (M, 2) pairs of indices. Those of
// lines before those that may be of points.
constexpr std::array<std::string_view, 4> kMatchKeys = {"line_matches0", "line_matches", "matches0",
                                                        "matches"};
constexpr std::array<std::string_view, 6> kMatchScoreKeys = {
    "line_matching_scores0", "line_match_scores0", "line_scores",
    "matching_scores0",      "match_scores0",      "scores"};

template <size_t n>
size_t PositionOf(const std::array<std::string_view, n>& keys, std::string_view key) {
  return static_cast<size_t>(std::find(keys.begin(), keys.end(), key) - keys.begin());
}

// Scores are larger where a match is better, distances smaller.
float DistanceOfScore(float score) { return 1.0f - score; }

std::vector<LineMatch> TakeMatches(const StoredArray& stored, const StoredArray* scores) {
  const NumericArray& array = stored.array;
  const bool is_table = array.shape.size() == 2 && array.shape[1] == 2;
  if (!is_table && array.shape.size() != 1) {
    throw InputError(
        fmt::format("{}: expected matches of shape (N,) [index in the second image or "
                    "-1] or (M, 2) [index in the first, in the second], found {}",
                    stored.place, array.ShapeText()));
  }
  const uint64_t num_rows = array.shape[0];
  std::vector<float> score;
  if (scores != nullptr && scores->array.size() == num_rows) {
    score = scores->array.Values<float>();
  }
  const std::vector<int64_t> values = array.Values<int64_t>();
  std::vector<LineMatch> matches;
  for (uint64_t i = 0; i < num_rows; ++i) {
    const int64_t idx1 = is_table ? values[2 * i] : static_cast<int64_t>(i);
    const int64_t idx2 = is_table ? values[2 * i + 1] : values[i];
    if (!is_table && idx2 == -1) continue;
    if (idx1 < 0 || idx2 < 0 || idx1 >= kInvalidId32 || idx2 >= kInvalidId32) {
      throw InputError(
          fmt::format("{}: row {} matches segment {} with {}, expected indices of 0 "
                      "or more (-1: no match)",
                      stored.place, i, idx1, idx2));
    }
    LineMatch match{static_cast<line2D_t>(idx1), static_cast<line2D_t>(idx2), 0.0f};
    if (!score.empty()) {
      if (!std::isfinite(score[i])) {
        throw InputError(
            fmt::format("{}: row {} has a score that is not a finite number; remove the match",
                        scores->place, i));
      }
      match.distance = DistanceOfScore(score[i]);
    }
    matches.push_back(match);
  }
  return matches;
}

std::vector<RawLineMatches> ReadMatchArrays(const fs::path& path) {
  const StoredArrays stored = ReadStoredArrays(path, [](std::string_view array_path) {
    const std::string_view key = SplitLast(array_path).second;
    return PositionOf(kMatchKeys, key) < kMatchKeys.size() ||
           PositionOf(kMatchScoreKeys, key) < kMatchScoreKeys.size();
  });
  struct PairArrays {
    const StoredArray* matches = nullptr;
    const StoredArray* scores = nullptr;
    size_t matches_rank = kMatchKeys.size();
    size_t scores_rank = kMatchScoreKeys.size();
  };
  std::map<std::string, PairArrays> by_pair;
  for (const auto& [array_path, array] : stored) {
    const auto [pair, key] = SplitLast(array_path);
    PairArrays& arrays = by_pair[std::string(pair)];
    if (const size_t rank = PositionOf(kMatchKeys, key); rank < arrays.matches_rank) {
      arrays.matches_rank = rank;
      arrays.matches = &array;
    }
    if (const size_t rank = PositionOf(kMatchScoreKeys, key); rank < arrays.scores_rank) {
      arrays.scores_rank = rank;
      arrays.scores = &array;
    }
  }
  std::vector<RawLineMatches> result;
  for (const auto& [pair, arrays] : by_pair) {
    if (arrays.matches == nullptr) continue;
    // An archive of one pair: its name is the pair.
    const std::string name = pair.empty() ? path.stem().string() : pair;
    result.push_back(
        {name, false, TakeMatches(*arrays.matches, arrays.scores), arrays.matches->place});
  }
  return result;
}

}  // namespace

std::vector<RawLineMatches> ParseLineMatchText(std::string_view bytes, const fs::path& path) {
  std::vector<RawLineMatches> result;
  ImportLines lines(bytes, path);
  bool in_block = false;
  while (const std::optional<std::string_view> line = lines.Next()) {
    if (line->empty()) {
      in_block = false;
      continue;
    }
    if (!in_block) {
      result.push_back({std::string(*line), true, {}, lines.Place()});
      in_block = true;
      continue;
    }
    const std::vector<std::string_view> words = ImportLines::Words(*line);
    const auto idx1 = ImportLines::Number(words[0]);
    const auto idx2 = words.size() > 1 ? ImportLines::Number(words[1]) : std::nullopt;
    const auto distance = words.size() > 2 ? ImportLines::Real(words[2]) : 0.0;
    if (!idx1 || !idx2 || !distance || words.size() > 3 || *idx1 >= kInvalidId32 ||
        *idx2 >= kInvalidId32) {
      lines.Fail("expected IDX1 IDX2 [DISTANCE], found '" + ImportLines::Shown(*line) +
                 "'; a blank line ends the matches of a pair");
    }
    result.back().matches.push_back({static_cast<line2D_t>(*idx1), static_cast<line2D_t>(*idx2),
                                     static_cast<float>(*distance)});
  }
  return result;
}

LineMatchMap ImportLineMatches(const fs::path& path, const Reconstruction& model,
                               const std::map<image_t, ImportedSegments>& segments,
                               LineMatchImportReport* report) {
  if (!fs::exists(path)) throw NoSuchFileOrFolder(path);
  std::vector<RawLineMatches> all;
  if (path.extension() == ".txt") {
    all = ParseLineMatchText(ReadFileBytes(path), path);
  } else if (HoldsArrays(path)) {
    all = ReadMatchArrays(path);
    if (fs::is_directory(path)) {
      for (const auto& [name, file] : FilesBelow(path)) {
        if (file.extension() != ".txt") continue;
        std::vector<RawLineMatches> more = ParseLineMatchText(ReadFileBytes(file), file);
        std::move(more.begin(), more.end(), std::back_inserter(all));
      }
    }
  } else {
    throw InputError(path, "expected a folder, or a file that ends in .txt, .npz, .h5 or .hdf5");
  }
  if (all.empty()) {
    throw InputError(path,
                     "expected matches as text, or arrays named NAME1/NAME2/line_matches0 "
                     "(docs/import.md), found none");
  }

  ImageNames names(model);
  for (const bool is_text : {true, false}) {
    std::vector<std::string> pairs;
    for (const RawLineMatches& raw : all) {
      if (raw.is_text == is_text) pairs.push_back(raw.pair);
    }
    names.LearnFromPairs(pairs, is_text);
  }
  LineMatchMap result;
  std::string unknown;
  for (const RawLineMatches& raw : all) {
    const auto found =
        raw.is_text ? names.FindPairOfWords(raw.pair) : names.FindPair(raw.pair, raw.place);
    if (!found) {
      if (report->num_unknown_pairs++ == 0) unknown = raw.pair;
      continue;
    }
    const std::array<image_t, 2> ids = {found->first, found->second};
    std::array<const ImportedSegments*, 2> lists;
    for (size_t k = 0; k < 2; ++k) {
      const auto it = segments.find(ids[k]);
      if (it == segments.end() && !raw.matches.empty()) {
        throw InputError(raw.place + ": '" + model.images.at(ids[k]).name +
                         "' has no imported segments, which its matches count; import the segments "
                         "of all images");
      }
      lists[k] = it == segments.end() ? nullptr : &it->second;
    }
    const bool swapped = ids[0] > ids[1];
    std::vector<LineMatch>& matches = result[std::minmax(ids[0], ids[1])];
    for (const LineMatch& match : raw.matches) {
      const std::array<line2D_t, 2> rows = {match.idx1, match.idx2};
      std::array<line2D_t, 2> idxs;
      for (size_t k = 0; k < 2; ++k) {
        const std::vector<line2D_t>& idx_of_row = lists[k]->idx_of_row;
        if (rows[k] >= idx_of_row.size()) {
          throw InputError(fmt::format(
              "{}: segment {} of '{}' is matched, which has {} segments only; the matches must be "
              "made with the segments that are imported",
              raw.place, rows[k], model.images.at(ids[k]).name, idx_of_row.size()));
        }
        idxs[k] = idx_of_row[rows[k]];
      }
      if (idxs[0] == kInvalidId32 || idxs[1] == kInvalidId32) {
        ++report->dropped["of a segment that was dropped"];
        continue;
      }
      if (swapped) std::swap(idxs[0], idxs[1]);
      matches.push_back({idxs[0], idxs[1], match.distance});
    }
  }
  // A pair may be there both ways round.
  for (auto& [pair, matches] : result) {
    std::sort(matches.begin(), matches.end(), [](const LineMatch& a, const LineMatch& b) {
      return std::tie(a.idx1, a.idx2, a.distance) < std::tie(b.idx1, b.idx2, b.distance);
    });
    const auto end =
        std::unique(matches.begin(), matches.end(), [](const LineMatch& a, const LineMatch& b) {
          return a.idx1 == b.idx1 && a.idx2 == b.idx2;
        });
    if (end != matches.end()) {
      report->dropped["there twice"] += static_cast<size_t>(matches.end() - end);
    }
    matches.erase(end, matches.end());
    report->num_matches += matches.size();
  }
  report->num_pairs = result.size();
  if (result.empty()) throw names.NothingKnown(path, all.size(), "pair", unknown);
  if (report->num_unknown_pairs > 0)
    ImageNames::WarnOfUnknown(path, report->num_unknown_pairs, all.size(), "pair", unknown);
  return result;
}

}  // namespace holba
