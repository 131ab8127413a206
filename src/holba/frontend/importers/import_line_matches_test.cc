// SPDX-License-Identifier: BSD-3-Clause
#include "holba/frontend/importers/import_line_matches.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "holba/frontend/importers/import_golden_files.h"
#include "holba/frontend/importers/import_testing.h"

namespace holba {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

// 3, 10 and 3 segments in the files; the second of image 3 was dropped.
std::map<image_t, ImportedSegments> Segments() {
  std::map<image_t, ImportedSegments> segments;
  for (const auto& [image_id, count] : std::map<image_t, uint32_t>{{1, 3}, {2, 10}, {3, 3}}) {
    segments[image_id].segments.resize(count);
    for (uint32_t i = 0; i < count; ++i) segments[image_id].idx_of_row.push_back(i);
  }
  segments[3].segments.resize(2);
  segments[3].idx_of_row = {0, kInvalidId32, 1};
  return segments;
}

LineMatchMap Import(const std::filesystem::path& path, LineMatchImportReport* report = nullptr) {
  LineMatchImportReport ignored;
  return ImportLineMatches(path, SmallImportModel(), Segments(), report ? report : &ignored);
}

std::vector<std::tuple<uint32_t, uint32_t, float>> Rows(const std::vector<LineMatch>& matches) {
  std::vector<std::tuple<uint32_t, uint32_t, float>> rows;
  for (const LineMatch& m : matches) rows.emplace_back(m.idx1, m.idx2, m.distance);
  return rows;
}
using Row = std::tuple<uint32_t, uint32_t, float>;

TEST(LineMatchText, BlocksAreThoseOfColmap) {
  const TestFolder folder;
  const auto path = folder.Write("m.txt",
                                 "# comment\nb.jpg dir/a.jpg\n9 2 0.5\n0 1\n\n\nc.jpg b.jpg\n"
                                 "0 4\n1 5\n2 6\n\ndir/a.jpg b.jpg\n2 9 0.75\n");
  LineMatchImportReport report;
  const LineMatchMap matches = Import(path, &report);
  ASSERT_EQ(matches.size(), 2u);
  EXPECT_THAT(Rows(matches.at({1, 2})), ElementsAre(Row(1, 0, 0), Row(2, 9, 0.5f)));
  EXPECT_THAT(Rows(matches.at({2, 3})), ElementsAre(Row(4, 0, 0), Row(6, 1, 0)));
  EXPECT_EQ(report.num_pairs, 2u);
  EXPECT_EQ(report.num_matches, 4u);
  EXPECT_EQ(report.dropped.at("there twice"), 1u);
  EXPECT_EQ(report.dropped.at("of a segment that was dropped"), 1u);
}

TEST(LineMatchArrays, Hdf5OfHlocPrefersLinesToPoints) {
  const TestFolder folder;
  const auto path = folder.Write("m.h5", FromBase64(kHdf5Matches));
  const LineMatchMap matches = Import(path);
  ASSERT_EQ(matches.size(), 1u);
  EXPECT_THAT(Rows(matches.at({1, 2})), ElementsAre(Row(0, 7, 0.25f)));
}

TEST(LineMatchArrays, TablesOfTwoColumnsAndFoldersAreRead) {
  const TestFolder folder;
  const std::vector<int64_t> table = {2, 3, 0, 1};
  folder.Write("b.jpg/dir-a.jpg.npz",
               Zip({{"matches.npy", Npy("<i8", "(2, 2)", std::vector<int64_t>{3, 2, 1, 0})},
                    {"scores.npy", Npy("<f4", "(2,)", std::vector<float>{1.0f, 0.5f})}}));
  folder.Write("more.txt", "b.jpg c.jpg\n8 0\n");
  const LineMatchMap matches = Import(folder.path());
  EXPECT_THAT(Rows(matches.at({1, 2})), ElementsAre(Row(0, 1, 0.5f), Row(2, 3, 0)));
  EXPECT_THAT(Rows(matches.at({2, 3})), ElementsAre(Row(8, 0, 0)));
  const auto one = folder.Write(
      "all.npz", Zip({{"dir-a.jpg/b.jpg/line_matches.npy", Npy("<i8", "(2, 2)", table)}}));
  EXPECT_THAT(Rows(Import(one).at({1, 2})), ElementsAre(Row(0, 1, 0), Row(2, 3, 0)));
}

TEST(LineMatches, BadFilesAreRefusedWithPlaceAndReason) {
  const TestFolder folder;
  const auto text = [&](const std::string& bytes) {
    const auto path = folder.Write("m.txt", bytes);
    return MessageOf([&] { Import(path); });
  };
  EXPECT_THAT(text(""), HasSubstr("expected matches as text"));
  EXPECT_THAT(text("b.jpg c.jpg\n1 x\n"),
              HasSubstr("m.txt:2: expected IDX1 IDX2 [DISTANCE], found '1 x'; a blank line ends"));
  EXPECT_THAT(text("b.jpg c.jpg\n10 0\n"),
              HasSubstr("m.txt:1: segment 10 of 'b.jpg' is matched, which has 10 segments only"));
  EXPECT_THAT(text("b.jpg d.jpg\n1 0\n"),
              HasSubstr("none of its names (1 pair) is in the model; expected names like "
                        "'dir/a.jpg', found 'b.jpg d.jpg'"));
  const auto npz = [&](const std::string& npy) {
    const auto path = folder.Write("m.npz", Zip({{"b.jpg/c.jpg/matches0.npy", npy}}));
    return MessageOf([&] { Import(path); });
  };
  EXPECT_THAT(npz(Npy("<i4", "(1, 3)", std::vector<int>{1, 2, 3})),
              HasSubstr("m.npz: 'b.jpg/c.jpg/matches0': expected matches of shape (N,)"));
  EXPECT_THAT(npz(Npy("<i4", "(2,)", std::vector<int>{-1, -2})),
              HasSubstr("row 1 matches segment 1 with -2, expected indices of 0 or more"));
  EXPECT_THAT(MessageOf([&] {
                auto segments = Segments();
                segments.erase(3);
                LineMatchImportReport report;
                ImportLineMatches(folder.Write("m.txt", "b.jpg c.jpg\n1 0\n"), SmallImportModel(),
                                  segments, &report);
              }),
              HasSubstr("'c.jpg' has no imported segments, which its matches count"));
}

TEST(LineMatches, PairsOfOtherImagesAreCounted) {
  const TestFolder folder;
  LineMatchImportReport report;
  Import(folder.Write("m.txt", "b.jpg c.jpg\n1 0\n\nx y\n1 2\n"), &report);
  EXPECT_EQ(report.num_unknown_pairs, 1u);
  EXPECT_EQ(report.num_matches, 1u);
}

}  // namespace
}  // namespace holba
