// SPDX-License-Identifier: BSD-3-Clause
#include "holba/frontend/importers/import_segments.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "holba/frontend/importers/import_golden_files.h"
#include "holba/frontend/importers/import_names.h"
#include "holba/frontend/importers/import_testing.h"
#include "holba/scene/image_features.h"

namespace holba {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

std::vector<double> Flat(const std::vector<LineSegment2d>& segments) {
  std::vector<double> values;
  for (const LineSegment2d& s : segments) {
    for (const double x : {s.start.x(), s.start.y(), s.end.x(), s.end.y()}) values.push_back(x);
  }
  return values;
}

std::map<image_t, ImportedSegments> Import(const std::filesystem::path& path,
                                           SegmentImportReport* report = nullptr,
                                           const SegmentImportOptions& options = {}) {
  SegmentImportReport ignored;
  return ImportSegments(path, SmallImportModel(), options, report ? report : &ignored);
}

TEST(ImageNames, AnImageIsFoundByNameStemOrLimapsFile) {
  const ImageNames names(SmallImportModel());
  EXPECT_EQ(names.Find("dir/a.jpg"), 1u);
  EXPECT_EQ(names.Find("dir/a"), 1u);
  EXPECT_EQ(names.Find("segments_3"), 3u);
  EXPECT_EQ(names.Find("segments_4"), std::nullopt);
  EXPECT_EQ(names.Find("a.jpg"), std::nullopt);
  Reconstruction model = SmallImportModel();
  model.images.at(3).name = "b.png";
  EXPECT_EQ(ImageNames(model).Find("b"), std::nullopt) << "two images have this stem";
  EXPECT_EQ(ImageNames(model).Find("b.png"), 3u);
  model.images.at(3).name = "b.jpg";
  EXPECT_THAT(MessageOf([&] { ImageNames twice(model); }), HasSubstr("have the same name 'b.jpg'"));
}

TEST(ImageNames, PairsAreFoundAsHlocWritesThem) {
  Reconstruction model = SmallImportModel();
  const ImageNames names(model);
  using Pair = std::optional<std::pair<image_t, image_t>>;
  EXPECT_EQ(names.FindPair("dir-a.jpg/b.jpg", ""), (Pair{{1, 2}}));
  EXPECT_EQ(names.FindPair("b.jpg_dir-a.jpg", ""), (Pair{{2, 1}}));
  EXPECT_EQ(names.FindPair("dir/a.jpg/b.jpg", ""), (Pair{{1, 2}}));
  EXPECT_EQ(names.FindPair("b/c", ""), (Pair{{2, 3}}));
  EXPECT_EQ(names.FindPair("b.jpg/d.jpg", ""), Pair{});
  EXPECT_EQ(names.FindPairOfWords("dir/a.jpg  c.jpg"), (Pair{{1, 3}}));
  model.images.at(3).name = "dir-a.jpg";
  EXPECT_THAT(MessageOf([&] { ImageNames(model).FindPair("dir-a.jpg/b.jpg", "x.h5"); }),
              HasSubstr("x.h5: 'dir-a.jpg/b.jpg' may mean several pairs"));
  model.images.at(3).name = "with blank.jpg";
  EXPECT_EQ(ImageNames(model).FindPairOfWords("with blank.jpg b.jpg"), (Pair{{3, 2}}));
}

TEST(SegmentText, IsInColmapsPixels) {
  const TestFolder folder;
  folder.Write("dir/a.jpg.txt", "# by hand\n1 2 3 4\n\n10.5 20.25 30 40\r\n");
  folder.Write("b.txt", "5 6 7 8 0.25\n");
  SegmentImportReport report;
  const auto all = Import(folder.path(), &report);
  ASSERT_EQ(all.size(), 2u);
  EXPECT_THAT(Flat(all.at(1).segments), ElementsAre(1, 2, 3, 4, 10.5, 20.25, 30, 40));
  EXPECT_TRUE(all.at(1).scores.empty());
  EXPECT_THAT(Flat(all.at(2).segments), ElementsAre(5, 6, 7, 8));
  EXPECT_THAT(all.at(2).scores, ElementsAre(0.25f));
  EXPECT_EQ(report.num_images, 2u);
  EXPECT_EQ(report.num_segments, 3u);
  EXPECT_EQ(report.num_images_without, 1u);
}

TEST(SegmentText, OneFileMayHoldAllImages) {
  const TestFolder folder;
  const auto path = folder.Write("all.txt",
                                 "PIXEL_CENTRE 0\nIMAGE dir/a.jpg\n1 2 3 4\nIMAGE b.jpg\n"
                                 "SIZE 50 40\n1 2 3 4\nIMAGE c.jpg\n");
  const auto all = Import(path);
  EXPECT_THAT(Flat(all.at(1).segments), ElementsAre(1.5, 2.5, 3.5, 4.5));
  // Half the size: pixel 1 of it covers pixels 2 and 3, whose middle is 3.
  EXPECT_THAT(Flat(all.at(2).segments), ElementsAre(3, 5, 7, 9));
  EXPECT_TRUE(all.at(3).segments.empty());
}

TEST(SegmentText, LimapsCountIsChecked) {
  const TestFolder folder;
  folder.Write("segments_2.txt", "2\n1 2 3 4\n5 6 7 8\n");
  EXPECT_EQ(Import(folder.path()).at(2).segments.size(), 2u);
  folder.Write("segments_2.txt", "3\n1 2 3 4\n5 6 7 8\n");
  EXPECT_THAT(MessageOf([&] { Import(folder.path()); }),
              HasSubstr("expected as many segments as the first line says, 3, found 2"));
}

TEST(SegmentText, BadLinesAreNamed) {
  const auto message = [](const std::string& text) {
    return MessageOf([&] { ParseSegmentText(text, "x.txt", "x"); });
  };
  EXPECT_EQ(message("1 2 3 4\n1 2 3\n"),
            "x.txt:2: expected X1 Y1 X2 Y2 [SCORE], found 3 words: '1 2 3'");
  EXPECT_EQ(message("1 2 nan 4\n"), "x.txt:1: expected X2 (a finite number), found 'nan'");
  EXPECT_EQ(message("1 2 3 4,5\n"), "x.txt:1: expected Y2 (a finite number), found '4,5'");
  EXPECT_EQ(message("1 2 3 4\n1 2 3 4 5\n"),
            "x.txt:2: expected a SCORE for all segments of an image or for none");
  EXPECT_EQ(message("PIXEL_CENTRE 1\n"),
            "x.txt:1: expected 0 or 0.5 as the centre of the first pixel, found 1");
  EXPECT_EQ(message("SIZE 0 5\n"),
            "x.txt:1: expected the width and height of the image in pixels, found 0 and 5");
  EXPECT_EQ(message("IMAGE\n"), "x.txt:1: expected IMAGE NAME, found no name");
  EXPECT_EQ(message("IMAGE a\nIMAGE a\n"),
            "x.txt:2: the segments of 'a' are there twice; remove them here or above");
}

TEST(SegmentArrays, NpzOfAllImagesCountsPixelsFromZero) {
  const TestFolder folder;
  const auto path = folder.Write("all.npz", FromBase64(kNpzCompressed));
  SegmentImportReport report;
  const auto all = Import(path, &report);
  EXPECT_THAT(Flat(all.at(1).segments), ElementsAre(1.5, 2.5, 3.5, 4.5, 11, 20.75, 30.5, 40.5));
  EXPECT_EQ(all.at(2).segments.size(), 10u);
  EXPECT_EQ(report.num_unused_descriptors, 10u) << "they have 128 values, not ours";
  EXPECT_TRUE(all.at(2).descriptors.empty());
  SegmentImportOptions options;
  options.pixel_centre = PixelCentre::kHalf;
  EXPECT_THAT(Flat(Import(path, nullptr, options).at(1).segments),
              ElementsAre(1, 2, 3, 4, 10.5, 20.25, 30, 40));
}

TEST(SegmentArrays, NpzOfOneImageMaySayWhereItsCentresAre) {
  const TestFolder folder;
  folder.Write("dir/a.jpg.npz", FromBase64(kNpzStored));
  folder.Write("b.npy", FromBase64(kNpyFloat32));
  const auto all = Import(folder.path());
  EXPECT_THAT(Flat(all.at(1).segments), ElementsAre(1, 2, 3, 4, 10.5, 20.25, 30, 40));
  EXPECT_THAT(all.at(1).scores, ElementsAre(0.5f, 0.75f));
  EXPECT_THAT(Flat(all.at(2).segments), ElementsAre(1.5, 2.5, 3.5, 4.5, 11, 20.75, 30.5, 40.5));
}

TEST(SegmentArrays, Hdf5OfHlocIsRead) {
  const TestFolder folder;
  const auto path = folder.Write("features.h5", FromBase64(kHdf5Features));
  const auto all = Import(path);
  ASSERT_EQ(all.size(), 2u) << "the keypoints of c.jpg are points";
  EXPECT_THAT(Flat(all.at(1).segments), ElementsAre(1.5, 2.5, 3.5, 4.5, 11, 20.75, 30.5, 40.5));
  EXPECT_EQ(all.at(2).idx_of_row.size(), 10u);
}

TEST(SegmentArrays, OurDescriptorsAreTakenWithUnitNormByRowsOrColumns) {
  const TestFolder folder;
  std::vector<float> rows(3 * 72, 0.0f), columns(3 * 72, 0.0f);
  for (size_t i = 0; i < 3; ++i) {
    for (size_t k = 0; k < 72; ++k) {
      rows[i * 72 + k] = columns[k * 3 + i] = static_cast<float>(1 + (i + 2 * k) % 5);
    }
  }
  const std::vector<float> lines = {1, 2, 3, 4, 5, 5, 5, 5, 9, 8, 7, 6};  // the second is a point
  const std::string lines_npy = Npy("<f4", "(3, 4)", lines);
  folder.Write("b.npz",
               Zip({{"lines.npy", lines_npy}, {"descriptors.npy", Npy("<f4", "(3, 72)", rows)}}));
  folder.Write("c.npz", Zip({{"lines.npy", lines_npy},
                             {"descriptors.npy", Npy("<f4", "(72, 3)", columns)}}));
  SegmentImportReport report;
  const auto all = Import(folder.path(), &report);
  const ImportedSegments& b = all.at(2);
  EXPECT_EQ(b.segments.size(), 2u);
  EXPECT_THAT(b.idx_of_row, ElementsAre(0, kInvalidId32, 1));
  EXPECT_EQ(report.dropped.at("no length"), 2u);
  ASSERT_EQ(b.descriptors.size(), 2u * kSegmentDescriptorSize);
  EXPECT_EQ(b.descriptors, all.at(3).descriptors);
  for (const size_t i : {0, 1}) {
    double norm = 0.0, given = 0.0;
    for (size_t k = 0; k < 72; ++k) {
      norm += std::pow(b.descriptors[i * 72 + k], 2);
      given += std::pow(rows[2 * i * 72 + k], 2);
    }
    EXPECT_NEAR(norm, 1.0, 1e-5);
    EXPECT_NEAR(b.descriptors[i * 72 + 5], rows[2 * i * 72 + 5] / std::sqrt(given), 1e-6);
  }
}

TEST(SegmentArrays, WrongShapesAndNumbersAreNamed) {
  const TestFolder folder;
  const auto message = [&](const std::string& lines_npy) {
    folder.Write("b.npz", Zip({{"lines.npy", lines_npy}}));
    return MessageOf([&] { Import(folder.path()); });
  };
  EXPECT_THAT(message(Npy("<f4", "(2, 3)", std::vector<float>(6))),
              HasSubstr("b.npz: 'lines': expected segments of shape (N, 4) [x1 y1 x2 y2], (N, 5) "
                        "with a score, or (N, 2, 2) [[x1 y1] [x2 y2]], found (2, 3) float32"));
  EXPECT_THAT(message(Npy("<f4", "(1, 4)", std::vector<float>{1, 2, NAN, 4})),
              HasSubstr("'lines': segment 0 has the number nan"));
  EXPECT_THAT(
      message(Npy("<f4", "(1, 4)", std::vector<float>{1, 2, 300, 4})),
      HasSubstr("segment 0 of 'b.jpg' ends at (300.5, 4.5), 200.5 px outside of the image, which "
                "is 100 x 80; give the size of the image that the detector worked on"));
  EXPECT_EQ(message(Npy("<f4", "(1, 4)", std::vector<float>{1, 2, 101.4f, 81.4f})), "")
      << "a little outside is what detectors do";
  EXPECT_EQ(message(Npy("<f4", "(0, 4)", std::vector<float>{})), "");
  folder.Write("b.npz", Zip({{"lines.npy", Npy("<f4", "(1, 4)", std::vector<float>{1, 2, 3, 4})},
                             {"descriptors.npy", Npy("<f4", "(2, 9)", std::vector<float>(18))}}));
  EXPECT_THAT(MessageOf([&] { Import(folder.path()); }),
              HasSubstr("expected descriptors of shape (1, D) or (D, 1) as there are 1 segments"));
}

TEST(ImportSegments, NamesThatAreNoImageAreCountedAndAllOfThemAreRefused) {
  const TestFolder folder;
  folder.Write("b.txt", "1 2 3 4\n");
  folder.Write("other.txt", "1 2 3 4\n");
  SegmentImportReport report;
  EXPECT_EQ(Import(folder.path(), &report).size(), 1u);
  EXPECT_EQ(report.num_unknown_names, 1u);
  std::filesystem::remove(folder.path() / "b.txt");
  EXPECT_THAT(MessageOf([&] { Import(folder.path()); }),
              HasSubstr("none of its names (1 image) is in the model; expected names like "
                        "'dir/a.jpg', found 'other'"));
  folder.Write("b.txt", "1 2 3 4\n");
  folder.Write("b.npy", FromBase64(kNpyFloat32));
  EXPECT_THAT(MessageOf([&] { Import(folder.path()); }), HasSubstr("'b' are there twice"));
  std::filesystem::remove(folder.path() / "b.npy");
  folder.Write("b.jpg.npy", FromBase64(kNpyFloat32));
  EXPECT_THAT(MessageOf([&] { Import(folder.path()); }),
              HasSubstr("'b.jpg' and 'b' are the same image; remove one"));
}

TEST(ImportSegments, PathsWithoutSegmentsAreRefused) {
  const TestFolder folder;
  EXPECT_THAT(MessageOf([&] { Import(folder.path() / "none.txt"); }), HasSubstr("no such file"));
  EXPECT_THAT(MessageOf([&] { Import(folder.path()); }),
              HasSubstr("of segments in this folder, found none"));
  EXPECT_THAT(MessageOf([&] { Import(folder.Write("x.json", "{}")); }),
              HasSubstr("ends in .txt, .npz, .npy, .h5 or .hdf5"));
  EXPECT_THAT(MessageOf([&] { Import(folder.Write("x.h5", FromBase64(kHdf5Matches))); }),
              HasSubstr("found no segments"));
}

}  // namespace
}  // namespace holba
