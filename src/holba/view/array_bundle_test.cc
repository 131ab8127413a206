// SPDX-License-Identifier: BSD-3-Clause
#include "holba/view/array_bundle.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <zlib.h>

#include <cmath>
#include <limits>

#include "holba/view/view_testing.h"

namespace holba {
namespace {

TEST(HalfOf, EveryHalfIsItself) {
  for (uint32_t half = 0; half < 0x10000; ++half) {
    if ((half & 0x7c00) == 0x7c00) continue;  // infinities and NaN are never written
    ASSERT_EQ(HalfOf(FloatOfHalf(static_cast<uint16_t>(half))), half);
  }
}

TEST(HalfOf, NothingIsNearer) {
  for (const float value : {1.0001f, 0.3333333f, -7.77f, 2049.0f, 1e-7f, 5.9e-5f, 65519.0f}) {
    const uint16_t half = HalfOf(value);
    const float error = std::abs(FloatOfHalf(half) - value);
    for (const int step : {-1, 1}) {
      const auto other = static_cast<uint16_t>(half + step);
      if ((other & 0x7c00) == 0x7c00) continue;
      EXPECT_LE(error, std::abs(FloatOfHalf(other) - value)) << value;
    }
  }
}

TEST(HalfOf, WhatIsBeyondBecomesTheGreatest) {
  EXPECT_EQ(FloatOfHalf(HalfOf(1e30f)), 65504.0f);
  EXPECT_EQ(FloatOfHalf(HalfOf(-std::numeric_limits<float>::infinity())), -65504.0f);
  EXPECT_EQ(HalfOf(std::numeric_limits<float>::quiet_NaN()), 0);
}

TEST(Base64, IsThatOfRfc4648) {
  const std::pair<std::string, std::string> examples[] = {{"", ""},
                                                          {"f", "Zg=="},
                                                          {"fo", "Zm8="},
                                                          {"foo", "Zm9v"},
                                                          {"foob", "Zm9vYg=="},
                                                          {"fooba", "Zm9vYmE="},
                                                          {"foobar", "Zm9vYmFy"}};
  for (const auto& [bytes, text] : examples) EXPECT_EQ(Base64(bytes), text);
  std::string all;
  for (int i = 0; i < 256; ++i) all += static_cast<char>(i);
  EXPECT_EQ(FromBase64(Base64(all)), all);
}

TEST(Deflate, ZlibGivesItBack) {
  std::string bytes;
  for (int i = 0; i < 100000; ++i) bytes += static_cast<char>(i * i >> 3);
  const std::string deflated = Deflate(bytes);
  EXPECT_LT(deflated.size(), bytes.size());
  EXPECT_EQ(Inflated(deflated), bytes);
  EXPECT_EQ(Inflated(Deflate("")), "");
}

TEST(ArrayBundle, ArraysComeBackAndAreAligned) {
  ArrayBundle bundle;
  bundle.Add("bytes", std::vector<uint8_t>{1, 2, 3});
  bundle.Add("reals", std::vector<float>{0.5f, -1e30f});
  bundle.Add("counts", std::vector<uint32_t>{7, 0xffffffff});
  bundle.AddHalf("halves", std::vector<float>{0.25f, 3.0f});
  bundle.Add("nothing", std::vector<uint16_t>{});
  const ReadBundle read(bundle.ToBytes({{"name", "a"}}));
  EXPECT_EQ(read.meta["name"], "a");
  EXPECT_THAT(read.Get<uint8_t>("bytes"), testing::ElementsAre(1, 2, 3));
  EXPECT_THAT(read.Get<float>("reals"), testing::ElementsAre(0.5f, -1e30f));
  EXPECT_THAT(read.Get<uint32_t>("counts"), testing::ElementsAre(7, 0xffffffff));
  EXPECT_THAT(read.GetHalves("halves"), testing::ElementsAre(0.25f, 3.0f));
  EXPECT_TRUE(read.Get<uint16_t>("nothing").empty());
}

TEST(ArrayBundle, NamesOfAnyBytesAreAscii) {
  const std::string bytes = ArrayBundle().ToBytes({{"name", "</script>\xff\xfe\"\n\xe2\x98\x83"}});
  for (const char c : bytes.substr(8)) EXPECT_TRUE(c == 0 || (c >= 0x20 && c < 0x7f));
  EXPECT_EQ(ReadBundle(bytes).meta["name"], "</script>\xef\xbf\xbd\xef\xbf\xbd\"\n\xe2\x98\x83");
}

}  // namespace
}  // namespace holba
