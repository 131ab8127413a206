// SPDX-License-Identifier: BSD-3-Clause
#include "holba/pipeline/match_lines.h"

#include <gmock/gmock.h>

#include "holba/pipeline/detection.h"
#include "holba/pipeline/pipeline_testing.h"

namespace holba {
namespace {

using ::testing::ElementsAre;

class Matching : public PipelineTest {
 protected:
  LineMatchMap Match(MatchLinesReport* report, const std::string& import_path = "") {
    *report = {};
    Database database(folder_ / "database.db");
    const auto database_id = database.MatchImages(model_);
    std::map<image_t, ImportedSegments> imported;
    DetectionReport detection;
    const ImageFeatureMap features = DetectFeatures(detection_, folder_, model_, database_id,
                                                    &database, &imported, &detection);
    return MatchLines(options_, import_path, model_, features, database_id, imported, &database,
                      report);
  }
  std::pair<size_t, size_t> PairsAndReused() {
    MatchLinesReport report;
    Match(&report);
    return {report.num_pairs, report.pairs_reused};
  }

  DetectionOptions detection_{.num_threads = 2};
  MatchLinesOptions options_{.num_threads = 2};
};

std::vector<ImagePair> PairsOf(const LineMatchMap& matches) {
  std::vector<ImagePair> pairs;
  for (const auto& [pair, list] : matches) pairs.push_back(pair);
  return pairs;
}

TEST_F(Matching, OfASecondRunIsTakenFromTheDatabase) {
  MatchLinesReport first, second;
  const LineMatchMap made = Match(&first);
  EXPECT_THAT(PairsOf(made), ElementsAre(ImagePair{3, 5}, ImagePair{3, 8}, ImagePair{5, 8}));
  EXPECT_EQ(first.num_pairs, 3u);
  EXPECT_EQ(first.pairs_reused, 0u);
  EXPECT_GE(first.num_line_matches, 3 * 24u);  // the sides of six rectangles

  const LineMatchMap stored = Match(&second);
  EXPECT_EQ(second.pairs_reused, 3u);
  EXPECT_EQ(second.num_line_matches, first.num_line_matches);
  for (const auto& [pair, list] : made) {
    const std::vector<LineMatch>& other = stored.at(pair);
    ASSERT_EQ(list.size(), other.size());
    for (size_t i = 0; i < list.size(); ++i) {
      EXPECT_EQ(list[i].idx1, other[i].idx1);
      EXPECT_EQ(list[i].idx2, other[i].idx2);
      EXPECT_EQ(list[i].distance, other[i].distance);
    }
  }
}

TEST_F(Matching, IsMadeAnewWhereItsGroundsChanged) {
  using Counts = std::pair<size_t, size_t>;
  EXPECT_EQ(PairsAndReused(), Counts(3, 0));
  // Other segments of one image: its two pairs.
  WritePhotograph(8, 180.0);
  EXPECT_EQ(PairsAndReused(), Counts(3, 1));
  // A shared point more: one pair.
  AddPoint({0.1, 0.1, 4.0}, {3, 5});
  EXPECT_EQ(PairsAndReused(), Counts(3, 2));
  // Another pose: the two pairs of its image.
  model_.SetFramePose(5, Rigid3d{Eigen::Quaterniond::Identity(), {0.01, 0, 0}});
  EXPECT_EQ(PairsAndReused(), Counts(3, 1));
  options_.matching.num_matches = 1;
  EXPECT_EQ(PairsAndReused(), Counts(3, 0));
  EXPECT_EQ(PairsAndReused(), Counts(3, 3));
}

TEST_F(Matching, IsOfChosenPairsOnly) {
  AddPoint({0.1, 0.1, 4.0}, {3, 5});
  options_.pairs.min_shared_points = 36;
  MatchLinesReport report;
  EXPECT_THAT(PairsOf(Match(&report)), ElementsAre(ImagePair{3, 5}));
}

TEST_F(Matching, IsTakenFromAFile) {
  detection_.imports.segments =
      Write("segments.txt", "IMAGE 3.png\n10 20 100 25\n30 40 90 140\nIMAGE 5.png\n12 20 102 25\n")
          .string();
  const std::string path = Write("matches.txt", "3.png 5.png\n1 0 0.5\n\n").string();
  MatchLinesReport report;
  const LineMatchMap matches = Match(&report, path);
  EXPECT_TRUE(report.matches_imported);
  EXPECT_EQ(report.num_line_matches, 1u);
  ASSERT_THAT(PairsOf(matches), ElementsAre(ImagePair{3, 5}));
  EXPECT_EQ(matches.at({3, 5})[0].idx1, 1u);
  EXPECT_EQ(matches.at({3, 5})[0].idx2, 0u);
  EXPECT_THAT(MatchingText(report), testing::HasSubstr("1 segment match (imported)"));
}

}  // namespace
}  // namespace holba
