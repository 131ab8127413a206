// SPDX-License-Identifier: BSD-3-Clause
#include "holba/frontend/importers/npz.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "holba/base/random.h"
#include "holba/frontend/importers/import_golden_files.h"
#include "holba/frontend/importers/import_testing.h"

namespace holba {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::StartsWith;

NumericArray FromGolden(const char* base64) { return ParseNpy(FromBase64(base64), "x.npy"); }

TEST(Npy, ReadsWhatNumpyWrote) {
  NumericArray array = FromGolden(kNpyFloat32);
  EXPECT_EQ(array.ShapeText(), "(2, 4) float32");
  EXPECT_THAT(array.Values<double>(), ElementsAre(1, 2, 3, 4, 10.5, 20.25, 30, 40));
  array = FromGolden(kNpyInt64);
  EXPECT_EQ(array.ShapeText(), "(3,) int64");
  EXPECT_THAT(array.Values<int64_t>(), ElementsAre(-1, 3, int64_t{1} << 40));
  array = FromGolden(kNpyBytesV3);
  EXPECT_THAT(array.Values<float>(), ElementsAre(0, 255, 7));
  array = FromGolden(kNpyScalar);
  EXPECT_TRUE(array.shape.empty());
  EXPECT_THAT(array.Values<double>(), ElementsAre(0.5));
}

TEST(Npy, FortranOrderBecomesRowOrder) {
  const NumericArray array = FromGolden(kNpyFortran);
  EXPECT_THAT(array.shape, ElementsAre(3, 2, 2));
  EXPECT_THAT(array.Values<double>(), ElementsAre(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11));
}

TEST(Npy, ByteOrderIsThatOfTheFile) {
  EXPECT_THAT(FromGolden(kNpyBigEndian).Values<int64_t>(), ElementsAre(1, -2, 300, 70000));
}

TEST(Npy, HalfPrecisionIsExact) {
  const std::vector<double> values = FromGolden(kNpyHalfV2).Values<double>();
  ASSERT_EQ(values.size(), 6u);
  EXPECT_EQ(values[0], 1.5);
  EXPECT_EQ(values[1], -0.25);
  EXPECT_EQ(values[2], 1023.0 * std::ldexp(1.0, -24));  // 6.1e-5: the largest subnormal number
  EXPECT_EQ(values[3], std::ldexp(1.0, -24));           // the smallest
  EXPECT_EQ(values[4], 65504.0);
  EXPECT_EQ(values[5], INFINITY);
}

TEST(Npy, EveryHalfPrecisionNumberIsSignTimesFractionTimesPower) {
  std::vector<uint16_t> bits(65536);
  for (size_t i = 0; i < bits.size(); ++i) bits[i] = static_cast<uint16_t>(i);
  const std::vector<double> values =
      ParseNpy(Npy("<f2", "(65536,)", bits), "x.npy").Values<double>();
  for (size_t i = 0; i < bits.size(); ++i) {
    const int exponent = static_cast<int>(i >> 10 & 31);
    const double fraction = static_cast<double>(i & 1023) / 1024.0;
    const double sign = i & 0x8000 ? -1.0 : 1.0;
    if (exponent == 31) {
      EXPECT_EQ(std::isnan(values[i]), fraction != 0.0);
      if (fraction == 0.0) {
        EXPECT_EQ(values[i], sign * INFINITY);
      }
    } else {
      const double expected = exponent == 0 ? fraction * std::ldexp(1.0, -14)
                                            : (1.0 + fraction) * std::ldexp(1.0, exponent - 15);
      EXPECT_EQ(values[i], sign * expected) << i;
    }
  }
}

TEST(Npy, RealsThatAreNoIntegersOfThatSizeBecomeTheSmallest) {
  const std::vector<double> values = {NAN, 1e30, -1e30, 2.75, -2.75};
  const int64_t none = std::numeric_limits<int64_t>::min();
  EXPECT_THAT(ParseNpy(Npy("<f8", "(5,)", values), "x").Values<int64_t>(),
              ElementsAre(none, none, none, 2, -2));
}

TEST(Npy, BadFilesAreRefusedWithTheReason) {
  const auto message = [](const std::string& bytes) {
    return MessageOf([&] { ParseNpy(bytes, "x.npy"); });
  };
  EXPECT_THAT(message("PK"), StartsWith("x.npy: this is no array of numpy"));
  EXPECT_THAT(message(FromBase64(kNpyPickle)), HasSubstr("pickled Python objects"));
  EXPECT_THAT(message(FromBase64(kNpyRecords)), HasSubstr("structured type"));
  std::string bytes = FromBase64(kNpyFloat32);
  EXPECT_THAT(
      message(bytes.substr(0, bytes.size() - 1)),
      HasSubstr("has 31 bytes of numbers, expected 32 of a (2, 4) float32, so that it is trunc"));
  EXPECT_THAT(message(bytes + "x"), HasSubstr("has 33 bytes of numbers"));
  EXPECT_THAT(message(bytes.substr(0, 40)), HasSubstr("truncated in its header"));
  bytes[6] = 9;
  EXPECT_THAT(message(bytes), HasSubstr("version 9 of .npy is not known"));
  const std::vector<float> none;
  EXPECT_THAT(message(Npy("<c8", "(1,)", none)), HasSubstr("is of type '<c8', expected numbers"));
  EXPECT_THAT(message(Npy("<U4", "(1,)", none)), HasSubstr("is of type '<U4'"));
  EXPECT_THAT(message(Npy("<f4", "(100000, 100000)", none)), HasSubstr("larger than 1024 MiB"));
  EXPECT_THAT(message(Npy("<f4", "(4294967296, 4294967296, 4294967296)", none)),
              HasSubstr("larger than 1024 MiB"));
  EXPECT_THAT(message(Npy("<f4", "(-1,)", none)), HasSubstr("damaged shape"));
  EXPECT_THAT(message(Npy("<f4", "(1, 2", none)), HasSubstr("damaged shape"));
}

TEST(Npz, ReadsStoredAndDeflatedArrays) {
  const NpzArchive stored(FromBase64(kNpzStored), "x.npz");
  EXPECT_THAT(stored.Names(), ElementsAre("line_scores", "lines", "pixel_centre"));
  EXPECT_THAT(stored.Read("lines").Values<double>(), ElementsAre(1, 2, 3, 4, 10.5, 20.25, 30, 40));
  EXPECT_THAT(stored.Read("line_scores").Values<double>(), ElementsAre(0.5, 0.75));
  const NpzArchive packed(FromBase64(kNpzCompressed), "x.npz");
  EXPECT_THAT(packed.Names(), ElementsAre("b.jpg/descriptors", "b.jpg/segments", "dir/a.jpg"));
  const std::vector<double> values = packed.Read("b.jpg/segments").Values<double>();
  ASSERT_EQ(values.size(), 40u);
  for (size_t i = 0; i < values.size(); ++i) EXPECT_EQ(values[i], static_cast<double>(i % 17));
}

TEST(Npz, Zip64RecordsGiveTheNumbersThatDidNotFit) {
  const std::string data = Npy("<f4", "(1,)", std::vector<float>{2.5f});
  const uint32_t crc = static_cast<uint32_t>(
      crc32(0, reinterpret_cast<const Bytef*>(data.data()), static_cast<uInt>(data.size())));
  const std::string head = Number(45, 2) + Number(0, 2) + Number(0, 2) + Number(0, 4) +
                           Number(crc, 4) + Number(0xffffffffu, 4) + Number(0xffffffffu, 4) +
                           Number(5, 2);
  const std::string extra =
      Number(1, 2) + Number(16, 2) + Number(data.size(), 8) + Number(data.size(), 8);
  const std::string local = "PK\x03\x04" + head + Number(20, 2) + "a.npy" + extra + data;
  const std::string extra3 =
      Number(1, 2) + Number(24, 2) + Number(data.size(), 8) + Number(data.size(), 8) + Number(0, 8);
  const std::string central = "PK\x01\x02" + Number(45, 2) + head + Number(28, 2) + Number(0, 2) +
                              Number(0, 2) + Number(0, 2) + Number(0, 4) + Number(0xffffffffu, 4) +
                              "a.npy" + extra3;
  const std::string end64 = "PK\x06\x06" + Number(44, 8) + Number(45, 2) + Number(45, 2) +
                            Number(0, 8) + Number(1, 8) + Number(1, 8) + Number(central.size(), 8) +
                            Number(local.size(), 8);
  const std::string locator =
      "PK\x06\x07" + Number(0, 4) + Number(local.size() + central.size(), 8) + Number(1, 4);
  const std::string end = "PK\x05\x06" + Number(0, 4) + Number(0xffffu, 2) + Number(0xffffu, 2) +
                          Number(0xffffffffu, 4) + Number(0xffffffffu, 4) + Number(0, 2);
  const NpzArchive archive(local + central + end64 + locator + end, "x.npz");
  EXPECT_THAT(archive.Read("a").Values<float>(), ElementsAre(2.5f));
}

TEST(Npz, BadArchivesAreRefusedWithTheReason) {
  const std::string array = Npy("<f4", "(1,)", std::vector<float>{2.5f});
  const std::string good = Zip({{"a.npy", array}, {"b.npy", array}});
  const auto message = [](const std::string& bytes) {
    return MessageOf([&] {
      const NpzArchive archive(bytes, "x.npz");
      for (const std::string& name : archive.Names()) archive.Read(name);
    });
  };
  ASSERT_EQ(message(good), "");
  EXPECT_THAT(message("text"), StartsWith("x.npz: this is no archive of numpy"));
  EXPECT_THAT(message(good.substr(0, good.size() - 1)),
              HasSubstr("the archive is truncated (it has no end record)"));
  EXPECT_THAT(message(Zip({{"a.npy", array}, {"a.npy", array}})), HasSubstr("'a' is there twice"));
  const auto changed = [&](size_t from, const std::string& what, const std::string& to) {
    std::string bytes = good;
    return bytes.replace(bytes.find(what, from), what.size(), to);
  };
  const size_t directory = good.find("PK\x01\x02");
  std::string bytes = good;
  bytes[array.size() + 30] ^= 1;  // a bit of the numbers of the first
  EXPECT_THAT(message(bytes), HasSubstr("'a' has a wrong checksum"));
  bytes = good;
  bytes[directory + 8] = 1;
  EXPECT_THAT(message(bytes), HasSubstr("is encrypted"));
  bytes = good;
  bytes[directory + 10] = 14;
  EXPECT_THAT(message(bytes), HasSubstr("packed by method 14"));
  bytes = good;
  bytes[directory + 10] = 8;
  EXPECT_THAT(message(bytes), HasSubstr("cannot be unpacked"));
  bytes = good;
  bytes.replace(directory + 24, 4, "\xff\xff\xff\x3f");
  EXPECT_THAT(message(bytes), HasSubstr("has not the size that is stated"));
  bytes[directory + 10] = 8;
  EXPECT_THAT(message(bytes), HasSubstr("announces 1073741823 bytes in"));
  bytes = good;
  bytes.replace(directory + 20, 4, "\xff\xff\xff\x3f");
  EXPECT_THAT(message(bytes), HasSubstr("'a.npy' is larger than the archive"));
  bytes = good;
  bytes[directory + 42] = 1;
  EXPECT_THAT(message(bytes), HasSubstr("not where the table of contents says"));
  EXPECT_THAT(message(changed(directory, "PK\x01\x02", "PK\x01\x03")),
              HasSubstr("entry 0 of the archive's table of contents is damaged"));
}

// Never a crash, whatever single byte is wrong, and never other numbers than those written: their
// checksum says so.
TEST(Npz, EveryByteMayBeAnything) {
  size_t num_refused = 0, num_read = 0;
  for (const char* golden : {kNpzStored, kNpzCompressed}) {
    const std::string good = FromBase64(golden);
    const NpzArchive original(good, "good");
    for (size_t at = 0; at < good.size(); ++at) {
      for (const int value : {0, 1, 0x7f, 0xff, good[at] ^ 0x10}) {
        std::string bytes = good;
        bytes[at] = static_cast<char>(value);
        try {
          const NpzArchive archive(bytes, "changed");
          for (const std::string& name : archive.Names()) {
            const NumericArray array = archive.Read(name);
            if (original.Contains(name)) {
              EXPECT_EQ(array.bytes, original.Read(name).bytes);
            }
            ++num_read;
          }
        } catch (const InputError&) {
          ++num_refused;
        }
      }
    }
    for (size_t size = 0; size < good.size(); ++size) {
      EXPECT_THROW(NpzArchive(good.substr(0, size), "cut"), InputError) << size;
    }
  }
  EXPECT_GT(num_refused, 1000u);
  EXPECT_GT(num_read, 1000u);
}

TEST(Npy, EveryByteMayBeAnything) {
  size_t num_refused = 0;
  for (const char* golden : {kNpyFloat32, kNpyFortran, kNpyHalfV2, kNpyScalar}) {
    const std::string good = FromBase64(golden);
    for (size_t at = 0; at < good.size(); ++at) {
      for (int value = 0; value < 256; ++value) {
        std::string bytes = good;
        bytes[at] = static_cast<char>(value);
        try {
          const NumericArray array = ParseNpy(bytes, "changed");
          EXPECT_EQ(array.bytes.size(), array.size() * BytesOf(array.type));
        } catch (const InputError&) {
          ++num_refused;
        }
      }
    }
  }
  EXPECT_GT(num_refused, 1000u);
}

}  // namespace
}  // namespace holba
