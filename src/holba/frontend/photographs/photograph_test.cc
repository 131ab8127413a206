// SPDX-License-Identifier: BSD-3-Clause
#include "holba/frontend/photographs/photograph.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
// libjpeg's header wants stdio's first.
#include <jpeglib.h>
#include <tiffio.h>

#include <fstream>
#include <iterator>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "holba/base/error.h"

namespace holba {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

class Photograph : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = std::filesystem::path(::testing::TempDir()) / "holba_photograph_test";
    std::filesystem::create_directories(folder_);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  std::string Bytes(const std::string& name) const {
    std::ifstream file(folder_ / name, std::ios::binary);
    return {std::istreambuf_iterator<char>(file), {}};
  }
  void Write(const std::string& name, const std::string& bytes) const {
    std::ofstream(folder_ / name, std::ios::binary) << bytes;
  }
  void ExpectFault(const std::string& name, const std::string& words) const {
    for (const bool grey : {false, true}) {
      try {
        if (grey) {
          ReadGreyImage(folder_ / name);
        } else {
          ReadColourImage(folder_ / name);
        }
        FAIL() << name << " was read";
      } catch (const InputError& error) {
        EXPECT_THAT(error.what(), HasSubstr(name));
        EXPECT_THAT(error.what(), HasSubstr(words));
      }
    }
  }

  static std::string Number(uint32_t value, int num_bytes) {
    std::string bytes;
    for (int i = 0; i < num_bytes; ++i)
      bytes += static_cast<char>(i < 4 ? value >> (8 * i) & 0xff : 0);
    return bytes;
  }
  static std::string BmpHeader(int width, int height, uint32_t bits, uint32_t num_colours) {
    return "BM" + Number(0, 8) + Number(54 + 4 * num_colours, 4) + Number(40, 4) +
           Number(static_cast<uint32_t>(width), 4) + Number(static_cast<uint32_t>(height), 4) +
           Number(1, 2) + Number(bits, 2) + Number(0, 16) + Number(num_colours, 4) + Number(0, 4);
  }
  // `bits`: 24 or 32; negative: the top row comes first.
  static std::string BmpOf(const ColourImage& image, int bits) {
    const int num_bits = std::abs(bits);
    std::string bytes = BmpHeader(image.width, bits < 0 ? -image.height : image.height,
                                  static_cast<uint32_t>(num_bits), 0);
    for (int k = 0; k < image.height; ++k) {
      const int y = bits < 0 ? k : image.height - 1 - k;
      size_t row_bytes = 0;
      for (int x = 0; x < image.width; ++x, row_bytes += static_cast<size_t>(num_bits) / 8) {
        const uint8_t* rgb = &image.pixels[3 * (static_cast<size_t>(y) * image.width + x)];
        for (int c = 2; c >= 0; --c) bytes += static_cast<char>(rgb[c]);
        if (num_bits == 32) bytes += '\xff';
      }
      bytes.append((4 - row_bytes % 4) % 4, '\0');
    }
    return bytes;
  }
  // Grey: the first channel. 16 bits: each value twice, which is the same of 65535.
  void WriteTiff(const std::string& name, const ColourImage& image, int bits, int photometric,
                 int orientation = ORIENTATION_TOPLEFT) const {
    const int num_channels = photometric == PHOTOMETRIC_RGB ? 3 : 1;
    TIFF* tiff = TIFFOpen((folder_ / name).c_str(), "w");
    ASSERT_NE(tiff, nullptr);
    TIFFSetField(tiff, TIFFTAG_IMAGEWIDTH, image.width);
    TIFFSetField(tiff, TIFFTAG_IMAGELENGTH, image.height);
    TIFFSetField(tiff, TIFFTAG_BITSPERSAMPLE, bits);
    TIFFSetField(tiff, TIFFTAG_SAMPLESPERPIXEL, num_channels);
    TIFFSetField(tiff, TIFFTAG_PHOTOMETRIC, photometric);
    TIFFSetField(tiff, TIFFTAG_PLANARCONFIG, PLANARCONFIG_CONTIG);
    TIFFSetField(tiff, TIFFTAG_ORIENTATION, orientation);
    for (int y = 0; y < image.height; ++y) {
      std::string row;
      for (int x = 0; x < image.width; ++x) {
        const uint8_t* rgb = &image.pixels[3 * (static_cast<size_t>(y) * image.width + x)];
        for (int c = 0; c < num_channels; ++c)
          row.append(static_cast<size_t>(bits) / 8, static_cast<char>(rgb[c]));
      }
      TIFFWriteScanline(tiff, row.data(), static_cast<uint32_t>(y));
    }
    TIFFClose(tiff);
  }
  void WriteCmykJpeg(const std::string& name, const ColourImage& image) const {
    std::FILE* file = std::fopen((folder_ / name).c_str(), "wb");
    ASSERT_NE(file, nullptr);
    jpeg_compress_struct info;
    jpeg_error_mgr errors;
    info.err = jpeg_std_error(&errors);
    jpeg_create_compress(&info);
    jpeg_stdio_dest(&info, file);
    info.image_width = static_cast<JDIMENSION>(image.width);
    info.image_height = static_cast<JDIMENSION>(image.height);
    info.input_components = 4;
    info.in_color_space = JCS_CMYK;
    jpeg_set_defaults(&info);
    jpeg_set_quality(&info, 100, TRUE);
    jpeg_start_compress(&info, TRUE);
    for (int y = 0; y < image.height; ++y) {
      std::vector<JSAMPLE> row;
      for (int x = 0; x < image.width; ++x) {
        const uint8_t* rgb = &image.pixels[3 * (static_cast<size_t>(y) * image.width + x)];
        row.insert(row.end(), rgb, rgb + 3);
        row.push_back(255);
      }
      JSAMPROW rows[1] = {row.data()};
      jpeg_write_scanlines(&info, rows, 1);
    }
    jpeg_finish_compress(&info);
    jpeg_destroy_compress(&info);
    std::fclose(file);
  }

  // Smooth, so that JPEG keeps it.
  static ColourImage Ramp(int width, int height) {
    ColourImage image{width, height, {}};
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {
        image.pixels.push_back(static_cast<uint8_t>(3 * x));
        image.pixels.push_back(static_cast<uint8_t>(4 * y));
        image.pixels.push_back(static_cast<uint8_t>(x + y));
      }
    }
    return image;
  }

  std::filesystem::path folder_;
};

TEST_F(Photograph, IsTheSameAfterPng) {
  const ColourImage image = Ramp(71, 53);
  WriteImage(image, folder_ / "a.png");
  const ColourImage read = ReadColourImage(folder_ / "a.png");
  EXPECT_EQ(read.width, 71);
  EXPECT_EQ(read.height, 53);
  EXPECT_EQ(read.pixels, image.pixels);
}

TEST_F(Photograph, IsNearlyTheSameAfterJpeg) {
  const ColourImage image = Ramp(64, 48);
  WriteImage(image, folder_ / "a.jpg");
  const ColourImage read = ReadColourImage(folder_ / "a.jpg");
  ASSERT_EQ(read.pixels.size(), image.pixels.size());
  double sum = 0.0;
  for (size_t i = 0; i < image.pixels.size(); ++i)
    sum += std::abs(static_cast<int>(read.pixels[i]) - image.pixels[i]);
  EXPECT_LT(sum / static_cast<double>(image.pixels.size()), 3.0);
}

TEST_F(Photograph, HasTheBrightnessOfItsColours) {
  const ColourImage image = Ramp(64, 48);
  for (const char* name : {"a.png", "a.jpg"}) {
    WriteImage(image, folder_ / name);
    const ColourImage colour = ReadColourImage(folder_ / name);
    const GreyImage grey = ReadGreyImage(folder_ / name);
    ASSERT_EQ(3 * grey.pixels.size(), colour.pixels.size());
    for (size_t i = 0; i < grey.pixels.size(); ++i) {
      const uint8_t* rgb = &colour.pixels[3 * i];
      // Colours of JPEG are rounded and clipped once more than its brightness.
      EXPECT_NEAR(grey.pixels[i], 0.299 * rgb[0] + 0.587 * rgb[1] + 0.114 * rgb[2], 2.5);
    }
  }
}

TEST_F(Photograph, IsReadByWhatItIsWhateverItsName) {
  const ColourImage image = Ramp(10, 10);
  WriteImage(image, folder_ / "a.png");
  Write("b.jpg", Bytes("a.png"));
  EXPECT_EQ(ReadColourImage(folder_ / "b.jpg").pixels, image.pixels);
}

// Files of 2 x 1 pixels by the PNG specification.
constexpr uint8_t kGreyOf16Bits[] = {
    0x89, 0x50, 0x4e, 0x47, 0x0d, 0x0a, 0x1a, 0x0a, 0x00, 0x00, 0x00, 0x0d, 0x49, 0x48,
    0x44, 0x52, 0x00, 0x00, 0x00, 0x02, 0x00, 0x00, 0x00, 0x01, 0x10, 0x00, 0x00, 0x00,
    0x00, 0x81, 0xd9, 0xfc, 0x15, 0x00, 0x00, 0x00, 0x0d, 0x49, 0x44, 0x41, 0x54, 0x78,
    0x9c, 0x63, 0x68, 0x68, 0xf8, 0xff, 0x1f, 0x00, 0x06, 0x82, 0x02, 0xff, 0xb3, 0xbe,
    0x51, 0x33, 0x00, 0x00, 0x00, 0x00, 0x49, 0x45, 0x4e, 0x44, 0xae, 0x42, 0x60, 0x82};
constexpr uint8_t kPalette[] = {
    0x89, 0x50, 0x4e, 0x47, 0x0d, 0x0a, 0x1a, 0x0a, 0x00, 0x00, 0x00, 0x0d, 0x49, 0x48, 0x44,
    0x52, 0x00, 0x00, 0x00, 0x02, 0x00, 0x00, 0x00, 0x01, 0x08, 0x03, 0x00, 0x00, 0x00, 0xc3,
    0xfc, 0x8f, 0xb8, 0x00, 0x00, 0x00, 0x06, 0x50, 0x4c, 0x54, 0x45, 0x09, 0x08, 0x07, 0xc8,
    0x64, 0x32, 0x79, 0x35, 0xa3, 0xa4, 0x00, 0x00, 0x00, 0x0b, 0x49, 0x44, 0x41, 0x54, 0x78,
    0x9c, 0x63, 0x60, 0x64, 0x00, 0x00, 0x00, 0x05, 0x00, 0x02, 0xd1, 0x66, 0x33, 0x78, 0x00,
    0x00, 0x00, 0x00, 0x49, 0x45, 0x4e, 0x44, 0xae, 0x42, 0x60, 0x82};
constexpr uint8_t kTransparent[] = {
    0x89, 0x50, 0x4e, 0x47, 0x0d, 0x0a, 0x1a, 0x0a, 0x00, 0x00, 0x00, 0x0d, 0x49, 0x48, 0x44,
    0x52, 0x00, 0x00, 0x00, 0x02, 0x00, 0x00, 0x00, 0x01, 0x08, 0x06, 0x00, 0x00, 0x00, 0xf4,
    0x22, 0x7f, 0x8a, 0x00, 0x00, 0x00, 0x11, 0x49, 0x44, 0x41, 0x54, 0x78, 0x9c, 0x63, 0x60,
    0x64, 0x62, 0x66, 0x60, 0x61, 0x65, 0xfb, 0x0f, 0x00, 0x01, 0x5b, 0x01, 0x15, 0xba, 0x7c,
    0x71, 0x2b, 0x00, 0x00, 0x00, 0x00, 0x49, 0x45, 0x4e, 0x44, 0xae, 0x42, 0x60, 0x82};

TEST_F(Photograph, OfAnyKindOfPngIsBroughtTo8BitsOfColour) {
  const auto read = [&](std::span<const uint8_t> bytes) {
    Write("kind.png", std::string(bytes.begin(), bytes.end()));
    return ReadColourImage(folder_ / "kind.png").pixels;
  };
  EXPECT_THAT(read(kGreyOf16Bits), ElementsAre(128, 128, 128, 255, 255, 255));
  EXPECT_THAT(read(kPalette), ElementsAre(200, 100, 50, 9, 8, 7));
  EXPECT_THAT(read(kTransparent), ElementsAre(1, 2, 3, 4, 5, 6));
}

TEST_F(Photograph, ThatIsATiffIsReadAsStoredWhateverItsBitsAndOrientation) {
  const ColourImage image = Ramp(23, 17);
  WriteTiff("rgb8.tif", image, 8, PHOTOMETRIC_RGB);
  EXPECT_EQ(ReadColourImage(folder_ / "rgb8.tif").pixels, image.pixels);
  EXPECT_EQ(ReadColourImage(folder_ / "rgb8.tif").width, 23);
  WriteTiff("turned.tif", image, 8, PHOTOMETRIC_RGB, ORIENTATION_BOTRIGHT);
  EXPECT_EQ(ReadColourImage(folder_ / "turned.tif").pixels, image.pixels);
  WriteTiff("rgb16.tif", image, 16, PHOTOMETRIC_RGB);
  EXPECT_EQ(ReadColourImage(folder_ / "rgb16.tif").pixels, image.pixels);
  WriteTiff("grey16.tif", image, 16, PHOTOMETRIC_MINISBLACK);
  const GreyImage grey = ReadGreyImage(folder_ / "grey16.tif");
  for (size_t i = 0; i < grey.pixels.size(); ++i) EXPECT_EQ(grey.pixels[i], image.pixels[3 * i]);
  Write("half.tif", Bytes("rgb8.tif").substr(0, 600));
  ExpectFault("half.tif", "cannot be decoded");
}

TEST_F(Photograph, ThatIsABmpIsReadWhateverItsBits) {
  const ColourImage image = Ramp(23, 17);
  for (const int bits : {24, 32, -24}) {  // negative: the top row first
    Write("a.bmp", BmpOf(image, bits));
    EXPECT_EQ(ReadColourImage(folder_ / "a.bmp").pixels, image.pixels) << bits;
    EXPECT_EQ(ReadColourImage(folder_ / "a.bmp").height, 17);
  }
  Write("half.bmp", BmpOf(image, 24).substr(0, 600));
  ExpectFault("half.bmp", "ends too early");
  // Two rows of three pixels with four colours of a palette, one byte each; bottom row first.
  std::string palette = BmpHeader(3, 2, 8, 4);
  for (const char* colour : {"\x01\x02\x03", "\x11\x12\x13", "\x21\x22\x23", "\x31\x32\x33"})
    palette += std::string(colour, 3) + '\0';
  palette += std::string("\0\1\2\0\3\2\1\0", 8);
  Write("palette.bmp", palette);
  EXPECT_THAT(ReadColourImage(folder_ / "palette.bmp").pixels,
              ElementsAre(0x33, 0x32, 0x31, 0x23, 0x22, 0x21, 0x13, 0x12, 0x11,  //
                          3, 2, 1, 0x13, 0x12, 0x11, 0x23, 0x22, 0x21));
}

TEST_F(Photograph, ThatIsAPnmIsReadWhateverItsKind) {
  using namespace std::string_literals;
  const auto read = [&](const std::string& bytes) {
    Write("a.ppm", bytes);
    return ReadColourImage(folder_ / "a.ppm").pixels;
  };
  EXPECT_THAT(read("P6 2 1 255\n\1\2\3\4\5\6"s), ElementsAre(1, 2, 3, 4, 5, 6));
  EXPECT_THAT(read("P5\n# by hand\n2 1\n65535\n\x80\x80\xff\xff"s),
              ElementsAre(128, 128, 128, 255, 255, 255));
  EXPECT_THAT(read("P3 1 1 15 15 0 3"), ElementsAre(255, 0, 51));
  EXPECT_THAT(read("P2 2 1 255 7 8\n"), ElementsAre(7, 7, 7, 8, 8, 8));
  EXPECT_THAT(read("P1 2 1 01"), ElementsAre(255, 255, 255, 0, 0, 0));
  EXPECT_THAT(read("P4 2 1\n\x40"), ElementsAre(255, 255, 255, 0, 0, 0));
  Write("half.ppm", "P6 20 10 255\n123456");
  ExpectFault("half.ppm", "ends too early");
  Write("huge.ppm", "P6 99999999 99999999 255\n123456");
  ExpectFault("huge.ppm", "ends too early");
}

TEST_F(Photograph, ThatIsAJpegForPrintersHasItsColours) {
  // Smooth, and without black ink: red is the first value as stored.
  const ColourImage image = Ramp(64, 48);
  WriteCmykJpeg("cmyk.jpg", image);
  const ColourImage read = ReadColourImage(folder_ / "cmyk.jpg");
  const GreyImage grey = ReadGreyImage(folder_ / "cmyk.jpg");
  ASSERT_EQ(read.pixels.size(), image.pixels.size());
  ASSERT_EQ(3 * grey.pixels.size(), image.pixels.size());
  for (size_t i = 0; i < image.pixels.size(); ++i) EXPECT_NEAR(read.pixels[i], image.pixels[i], 6);
  for (size_t i = 0; i < grey.pixels.size(); ++i) {
    const uint8_t* rgb = &read.pixels[3 * i];
    EXPECT_NEAR(grey.pixels[i], 0.299 * rgb[0] + 0.587 * rgb[1] + 0.114 * rgb[2], 0.6);
  }
}

TEST_F(Photograph, ThatIsAJpegCutOffIsReadAsFarAsItGoes) {
  const ColourImage image = Ramp(320, 240);
  WriteImage(image, folder_ / "a.jpg");
  EXPECT_FALSE(ReadGreyImage(folder_ / "a.jpg").ends_early);
  const std::string bytes = Bytes("a.jpg");
  Write("half.jpg", bytes.substr(0, 2 * bytes.size() / 3));
  const ColourImage whole = ReadColourImage(folder_ / "a.jpg");
  const ColourImage half = ReadColourImage(folder_ / "half.jpg");
  EXPECT_TRUE(ReadGreyImage(folder_ / "half.jpg").ends_early);
  ASSERT_EQ(half.pixels.size(), whole.pixels.size());
  const size_t row = 3 * 320;
  EXPECT_TRUE(std::equal(half.pixels.begin(), half.pixels.begin() + 8 * row, whole.pixels.begin()));
  EXPECT_NE(half.pixels, whole.pixels);
}

TEST_F(Photograph, ThatIsDamagedIsRefused) {
  const ColourImage image = Ramp(64, 48);
  for (const char* name : {"a.png", "a.jpg"}) {
    WriteImage(image, folder_ / name);
    const std::string bytes = Bytes(name);
    if (std::string_view(name) == "a.png") {
      Write("half_a.png", bytes.substr(0, bytes.size() / 2));
      ExpectFault("half_a.png", "cannot be decoded");
    }
    const std::string head = std::string("head_") + name;
    Write(head, bytes.substr(0, 20));
    ExpectFault(head, "cannot be decoded");
  }
  Write("text.jpg", "no image at all");
  ExpectFault("text.jpg", "expected a JPEG, PNG, TIFF, BMP or PNM");
  ExpectFault("missing.jpg", "there is no such image");
  // Any other byte of a file may be wrong: read or refused, never a crash.
  WriteTiff("a.tif", image, 8, PHOTOMETRIC_RGB);
  Write("a.bmp", BmpOf(image, 24));
  Write("a.ppm", "P6\n64 48\n255\n" + std::string(image.pixels.begin(), image.pixels.end()));
  for (const char* name : {"a.png", "a.jpg", "a.tif", "a.bmp", "a.ppm"}) {
    const std::string bytes = Bytes(name);
    for (size_t i = 0; i < bytes.size(); i += 1 + i / 50) {
      std::string wrong = bytes;
      wrong[i] = static_cast<char>(~wrong[i]);
      Write("wrong", wrong);
      try {
        ReadColourImage(folder_ / "wrong");
      } catch (const InputError&) {
      }
    }
  }
}

TEST_F(Photograph, ThatCannotBeWrittenIsAFault) {
  EXPECT_THROW(WriteImage(Ramp(4, 4), folder_ / "none" / "a.jpg"), InputError);
  EXPECT_THROW(WriteImage(Ramp(4, 4), folder_ / "none" / "a.png"), InputError);
}

}  // namespace
}  // namespace holba
