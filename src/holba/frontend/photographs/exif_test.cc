// SPDX-License-Identifier: BSD-3-Clause
#include "holba/frontend/photographs/exif.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <string>

#include "holba/base/error.h"
#include "holba/base/random.h"
#include "holba/frontend/photographs/exif_testing.h"
#include "holba/frontend/photographs/photograph.h"
#include "holba/frontend/photographs/photograph_header.h"

namespace holba {
namespace {

TEST(Exif, BothByteOrdersSayTheSame) {
  for (const bool big_endian : {false, true}) {
    ExifWriter writer(big_endian);
    writer.Text(ExifWriter::kMain, 0x010F, "Nikon ");
    writer.Text(ExifWriter::kMain, 0x0110, "D70");
    writer.Short(ExifWriter::kMain, 0x0112, 6);
    writer.Rationals(ExifWriter::kCamera, 0x920A, {{185, 10}});
    writer.Short(ExifWriter::kCamera, 0xA405, 28);
    writer.Text(ExifWriter::kGps, 1, "S");
    writer.Rationals(ExifWriter::kGps, 2, {{33, 1}, {51, 1}, {3528, 100}});
    writer.Text(ExifWriter::kGps, 3, "E");
    writer.Rationals(ExifWriter::kGps, 4, {{151, 1}, {12, 1}, {40, 1}});
    writer.Byte(ExifWriter::kGps, 5, 1);
    writer.Rationals(ExifWriter::kGps, 6, {{25, 2}});
    const Exif exif = ParseExif(writer.Bytes());
    EXPECT_EQ(exif.make, "Nikon");
    EXPECT_EQ(exif.model, "D70");
    EXPECT_EQ(exif.orientation, 6);
    EXPECT_EQ(exif.focal_length_mm, 18.5);
    EXPECT_EQ(exif.focal_length_35mm, 28.0);
    EXPECT_NEAR(exif.latitude_deg.value(), -(33.0 + 51.0 / 60 + 35.28 / 3600), 1e-12);
    EXPECT_NEAR(exif.longitude_deg.value(), 151.0 + 12.0 / 60 + 40.0 / 3600, 1e-12);
    EXPECT_EQ(exif.altitude_m, -12.5);
  }
}

TEST(Exif, FocalLengthsAreColmaps) {
  Exif exif;
  EXPECT_FALSE(FocalLengthPx(exif, 4000, 3000));
  exif.focal_length_mm = 20.0;
  EXPECT_FALSE(FocalLengthPx(exif, 4000, 3000));
  exif.focal_plane_x_resolution = 5000.0;
  exif.focal_plane_unit = 2;
  EXPECT_NEAR(FocalLengthPx(exif, 4000, 3000).value(), 20.0 * 5000.0 / 25.4, 1e-9);
  exif.focal_plane_unit = 3;
  EXPECT_NEAR(FocalLengthPx(exif, 4000, 3000).value(), 20.0 * 500.0, 1e-9);
  exif.focal_plane_unit = 7;
  EXPECT_FALSE(FocalLengthPx(exif, 4000, 3000));
  exif.focal_length_35mm = 0.0;  // not known, says EXIF
  EXPECT_FALSE(FocalLengthPx(exif, 4000, 3000));
  exif.focal_length_35mm = 43.27;
  EXPECT_NEAR(FocalLengthPx(exif, 4000, 3000).value(), 5000.0, 1e-9);
}

TEST(Exif, OneCameraWithOneLensAndSizeHasOneText) {
  Exif exif;
  exif.make = "A";
  exif.model = "B";
  EXPECT_FALSE(CameraText(exif, 40, 30));
  exif.focal_length_mm = 5.0;
  const auto text = CameraText(exif, 40, 30);
  ASSERT_TRUE(text);
  EXPECT_NE(text, CameraText(exif, 30, 40));
  exif.focal_length_mm = 6.0;
  EXPECT_NE(text, CameraText(exif, 40, 30));
}

TEST(Exif, CutOffOrRandomBytesAreReadWithinTheirBounds) {
  ExifWriter writer(false);
  writer.Text(ExifWriter::kMain, 0x010F, "A maker of cameras");
  writer.Rationals(ExifWriter::kCamera, 0x920A, {{185, 0}});
  writer.Rationals(ExifWriter::kGps, 2, {{33, 1}, {51, 1}, {3528, 100}});
  const std::string whole = writer.Bytes();
  EXPECT_FALSE(ParseExif(whole).focal_length_mm);  // 185 / 0
  for (size_t size = 0; size < whole.size(); ++size) ParseExif(std::string(whole, 0, size));
  Random random(3);
  for (int i = 0; i < 2000; ++i) {
    std::string bytes = whole;
    for (int k = 0; k < 3; ++k)
      bytes[random.Index(bytes.size())] = static_cast<char>(random.Index(256));
    ParseExif(bytes);
  }
}

class PhotographHeaderTest : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = std::filesystem::path(::testing::TempDir()) / "holba_photograph_header_test";
    std::filesystem::create_directories(folder_);
    writer_.Text(ExifWriter::kMain, 0x010F, "Maker");
    writer_.Short(ExifWriter::kMain, 0x0112, 8);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  ExifWriter writer_{true};
  std::filesystem::path folder_;
};

TEST_F(PhotographHeaderTest, SizeAndExifOfJpegAndPngAreFoundWithoutTheirPixels) {
  const ColourImage image{7, 5, std::vector<uint8_t>(105, 80)};
  for (const char* name : {"a.jpg", "a.png"}) {
    WriteImage(image, folder_ / name);
    const PhotographHeader plain = ReadPhotographHeader(folder_ / name);
    EXPECT_EQ(plain.width, 7u);
    EXPECT_EQ(plain.height, 5u);
    EXPECT_FALSE(plain.exif.make);
    AddExif(folder_ / name, writer_.Bytes());
    const PhotographHeader header = ReadPhotographHeader(folder_ / name);
    EXPECT_EQ(header.width, 7u);
    EXPECT_EQ(header.height, 5u);
    EXPECT_EQ(header.exif.make, "Maker");
    EXPECT_EQ(QuarterTurnsToUpright(header.exif), 1);
    EXPECT_EQ(ReadGreyImage(folder_ / name).width, 7);  // still an image
  }
}

TEST_F(PhotographHeaderTest, OtherFormatsAreReadAsAWholeAndDamageIsNamed) {
  std::ofstream(folder_ / "a.ppm", std::ios::binary) << "P5 3 2 255 abcdef";
  const PhotographHeader header = ReadPhotographHeader(folder_ / "a.ppm");
  EXPECT_EQ(header.width, 3u);
  EXPECT_EQ(header.height, 2u);
  std::ofstream(folder_ / "bad.jpg", std::ios::binary) << "\xff\xd8\xff\xe0 and nothing else";
  EXPECT_THROW(ReadPhotographHeader(folder_ / "bad.jpg"), InputError);
  EXPECT_THROW(ReadPhotographHeader(folder_ / "missing.jpg"), InputError);
}

}  // namespace
}  // namespace holba
