// SPDX-License-Identifier: BSD-3-Clause
#include "holba/frontend/importers/import_label_maps.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "holba/base/random.h"
#include "holba/frontend/importers/import_png.h"
#include "holba/frontend/importers/import_testing.h"

namespace holba {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

TEST(Png, ReadsGreyOfEveryDepth) {
  const PngImage one = ParsePng(Png(10, 2, 1, 0, {"\xa0\x40", "\x0f\x80"}), "x.png");
  EXPECT_THAT(one.values, ElementsAre(1, 0, 1, 0, 0, 0, 0, 0, 0, 1,  //
                                      0, 0, 0, 0, 1, 1, 1, 1, 1, 0));
  const PngImage two = ParsePng(Png(4, 1, 2, 0, {"\x1b"}), "x.png");
  EXPECT_THAT(two.values, ElementsAre(0, 1, 2, 3));
  const PngImage four = ParsePng(Png(3, 1, 4, 0, {"\x1f\x70"}), "x.png");
  EXPECT_THAT(four.values, ElementsAre(1, 15, 7));
  const PngImage eight = ParsePng(Png(2, 2, 8, 0, {"\x01\xff", "\x02\x03"}), "x.png");
  EXPECT_THAT(eight.values, ElementsAre(1, 255, 2, 3));
  const PngImage sixteen = ParsePng(Png(2, 1, 16, 0, {"\x01\x02\xff\xfe"}), "x.png");
  EXPECT_THAT(sixteen.values, ElementsAre(0x102, 0xfffe));
  EXPECT_EQ(sixteen.bit_depth, 16);
}

TEST(Png, IndicesOfAPaletteAreNotItsColours) {
  const PngImage image = ParsePng(Png(3, 1, 8, 3, {"\x05\x06\xc8"}), "x.png");
  EXPECT_EQ(image.channels, 1);
  EXPECT_THAT(image.values, ElementsAre(5, 6, 200));
}

// Filters as the PNG specification defines them, applied here by its formulas.
TEST(Png, UndoesEveryFilter) {
  Random random(3);
  constexpr int kWidth = 7, kHeight = 5, kChannels = 3;
  constexpr int kRow = kWidth * kChannels;
  std::vector<std::vector<int>> raw(kHeight, std::vector<int>(kRow));
  for (auto& row : raw) {
    for (int& value : row) value = static_cast<int>(random.Index(256));
  }
  for (int filter = 0; filter <= 4; ++filter) {
    std::vector<std::string> rows(kHeight);
    for (int y = 0; y < kHeight; ++y) {
      for (int i = 0; i < kRow; ++i) {
        const int a = i < kChannels ? 0 : raw[y][i - kChannels];
        const int b = y == 0 ? 0 : raw[y - 1][i];
        const int c = y == 0 || i < kChannels ? 0 : raw[y - 1][i - kChannels];
        const int p = a + b - c;
        const int nearest = std::min({std::abs(p - a), std::abs(p - b), std::abs(p - c)});
        const int paeth = nearest == std::abs(p - a) ? a : nearest == std::abs(p - b) ? b : c;
        const int predicted[] = {0, a, b, (a + b) / 2, paeth};
        rows[y] += static_cast<char>((raw[y][i] - predicted[filter]) & 255);
      }
    }
    const PngImage image = ParsePng(Png(kWidth, kHeight, 8, 2, rows, filter), "x.png");
    ASSERT_EQ(image.values.size(), static_cast<size_t>(kRow * kHeight));
    for (int i = 0; i < kRow * kHeight; ++i) {
      EXPECT_EQ(image.values[i], raw[i / kRow][i % kRow]) << "filter " << filter;
    }
  }
}

TEST(Png, BadFilesAreRefusedWithTheReason) {
  const std::string good = Png(2, 2, 8, 0, {"\x01\xff", "\x02\x03"});
  const auto message = [](const std::string& bytes) {
    return MessageOf([&] { ParsePng(bytes, "x.png"); });
  };
  ASSERT_EQ(message(good), "");
  EXPECT_EQ(message("GIF"),
            "x.png: this is no PNG picture; save it anew as PNG without interlacing");
  EXPECT_EQ(message(Png(2, 2, 8, 0, {"\x01\xff", "\x02\x03"}, 0, 1)),
            "x.png: the PNG picture is interlaced, which is not read; save it anew as PNG without "
            "interlacing");
  EXPECT_THAT(message(Png(2, 2, 8, 0, {"\x01\xff", "\x02\x03"}, 7)), HasSubstr("unknown filter"));
  EXPECT_THAT(message(Png(2, 3, 8, 0, {"\x01\xff", "\x02\x03"})),
              HasSubstr("cannot be unpacked in row 2"));
  EXPECT_THAT(message(Png(60000, 60000, 8, 0, {})), HasSubstr("60000 x 60000 pixels"));
  EXPECT_THAT(message(Png(16000, 16000, 16, 0, {})), HasSubstr("has only"));
  EXPECT_THAT(message(Png(2, 2, 3, 0, {})), HasSubstr("damaged header"));
  for (size_t size = 0; size < good.size(); ++size) {
    EXPECT_NE(message(good.substr(0, size)), "") << size;
  }
  std::string bytes = good;
  bytes[bytes.find("IDAT") + 6] ^= 1;
  EXPECT_THAT(message(bytes), HasSubstr("wrong checksum at byte 33"));
}

TEST(LabelTypes, AreNamedInAnyCase) {
  const auto types = ParseLabelTypes(
      R"({"labels": {"1": "plane", "65535": "Cylinder", "3": null, "4": "CUBOID"}})", "l.json");
  ASSERT_EQ(types.size(), 3u);
  EXPECT_EQ(types.at(1)->name, "PLANE");
  EXPECT_EQ(types.at(65535)->name, "CYLINDER");
  EXPECT_EQ(types.at(4)->name, "CUBOID");
}

TEST(LabelTypes, BadJsonIsRefusedWithTheReason) {
  const auto message = [](const std::string& json) {
    return MessageOf([&] { ParseLabelTypes(json, "l.json"); });
  };
  EXPECT_THAT(message("{\"labels\""), HasSubstr("l.json: this is no JSON"));
  EXPECT_THAT(message("{}"), HasSubstr("found no object \"labels\""));
  EXPECT_THAT(message("[1]"), HasSubstr("found no object \"labels\""));
  EXPECT_THAT(message(R"({"labels": {"0": "plane"}})"), HasSubstr("a label of 1 to 65535"));
  EXPECT_THAT(message(R"({"labels": {"70000": "plane"}})"), HasSubstr("found '70000'"));
  EXPECT_THAT(message(R"({"labels": {"1": "pyramid"}})"),
              HasSubstr("label 1 is 'pyramid', expected one of plane, sphere, cylinder, cone, "
                        "ellipsoid, cuboid, torus, bezier_curve, or null"));
  EXPECT_THAT(message(R"({"labels": {"1": "vp"}})"), HasSubstr("label 1 is 'vp'"))
      << "a vanishing point is no region";
  EXPECT_THAT(message(R"({"labels": {"1": 7}})"), HasSubstr("label 1 is 'number'"));
}

TEST(LabelMaps, TypesAreThoseOfTheImagesOwnFileOrOfAll) {
  const TestFolder folder;
  const std::string png = LabelPng(3, 2, [](int x, int y) { return x + 3 * y; });
  folder.Write("dir/a.jpg.png", png);
  folder.Write("b.png", png);
  folder.Write("labels.json", R"({"labels": {"1": "plane", "5": "cone", "6": "sphere"}})");
  folder.Write("b.json", R"({"labels": {"2": "sphere"}})");
  const auto a = ReadLabelMap(folder.path(), "dir/a.jpg");
  ASSERT_TRUE(a);
  EXPECT_EQ(a->width, 3);
  EXPECT_EQ(a->height, 2);
  EXPECT_THAT(a->labels, ElementsAre(0, 1, 2, 3, 4, 5));
  ASSERT_EQ(a->types.size(), 2u) << "no pixel has label 6";
  EXPECT_EQ(a->types.at(5)->name, "CONE");
  const auto b = ReadLabelMap(folder.path(), "b.jpg");
  ASSERT_TRUE(b);
  EXPECT_EQ(b->types.size(), 1u);
  EXPECT_EQ(b->types.at(2)->name, "SPHERE");
  EXPECT_FALSE(ReadLabelMap(folder.path(), "c.jpg"));
  std::filesystem::remove(folder.path() / "labels.json");
  EXPECT_THAT(MessageOf([&] { ReadLabelMap(folder.path(), "dir/a.jpg"); }),
              HasSubstr("labels.json: there is no such file, which says what the labels are"));
  EXPECT_THAT(MessageOf([&] { ParseLabelPng(Png(1, 1, 8, 2, {"\x01\x02\x03"}), "x.png"); }),
              HasSubstr("found a picture of 3 channels"));
}

TEST(Png, EveryByteMayBeAnything) {
  const std::string good =
      Png(5, 4, 8, 3, {"\x01\xff\x02\x03\x01", "abcde", "fghij", "\x05\x05\x05\x05\x05"});
  size_t num_refused = 0;
  for (size_t at = 0; at < good.size(); ++at) {
    for (int value = 0; value < 256; ++value) {
      std::string bytes = good;
      bytes[at] = static_cast<char>(value);
      try {
        const PngImage image = ParsePng(bytes, "changed");
        EXPECT_EQ(bytes, good) << "checksums find every change";
      } catch (const InputError&) {
        ++num_refused;
      }
    }
  }
  EXPECT_EQ(num_refused, 255 * good.size());
}

}  // namespace
}  // namespace holba
