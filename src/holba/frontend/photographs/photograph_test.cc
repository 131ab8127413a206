// SPDX-License-Identifier: BSD-3-Clause
#include "holba/frontend/photographs/photograph.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <iterator>
#include <span>

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

TEST_F(Photograph, ThatIsDamagedIsRefused) {
  const ColourImage image = Ramp(64, 48);
  for (const char* name : {"a.png", "a.jpg"}) {
    WriteImage(image, folder_ / name);
    const std::string bytes = Bytes(name);
    const std::string half = std::string("half_") + name;
    Write(half, bytes.substr(0, bytes.size() / 2));
    ExpectFault(half, "cannot be decoded");
    const std::string head = std::string("head_") + name;
    Write(head, bytes.substr(0, 20));
    ExpectFault(head, "cannot be decoded");
  }
  Write("text.jpg", "no image at all");
  ExpectFault("text.jpg", "neither a JPEG nor a PNG");
  ExpectFault("missing.jpg", "there is no such image");
  // Any other byte of a file may be wrong: read or refused, never a crash.
  for (const char* name : {"a.png", "a.jpg"}) {
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
