// SPDX-License-Identifier: BSD-3-Clause
#include "holba/io/side_files.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>

#include "holba/io/test_models.h"
#include "holba/scene/random_model.h"

namespace holba {
namespace {

// Little-endian fields one after the other, independent of the writer.
struct Bytes {
  std::string text;
  template <typename T>
  Bytes& Add(T value) {
    text.append(reinterpret_cast<const char*>(&value), sizeof(T));
    return *this;
  }
  Bytes& U8(uint8_t v) { return Add(v); }
  Bytes& U32(uint32_t v) { return Add(v); }
  Bytes& U64(uint64_t v) { return Add(v); }
  Bytes& F64(std::initializer_list<double> values) {
    for (const double v : values) Add(v);
    return *this;
  }
};

TEST(SideFiles, BinaryHasTheFieldsOfFormatInTheirTypes) {
  const Files binary =
      WriteFiles(ReadFiles(SmallModelText(), ModelFormat::kText), ModelFormat::kBinary);
  EXPECT_EQ(binary.at("lines2D"), Bytes()
                                      .U64(2)
                                      .U32(1)
                                      .U64(2)
                                      .F64({0, 0, 10, 0})
                                      .U64(1)
                                      .F64({5, 5, 6, 6})
                                      .U64(kNoId)
                                      .U32(2)
                                      .U64(1)
                                      .F64({0, 0, 10, 1})
                                      .U64(1)
                                      .text);
  EXPECT_EQ(binary.at("lines3D"), Bytes()
                                      .U64(2)
                                      .U64(1)
                                      .F64({1, 0, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0})
                                      .U8(1)
                                      .U8(2)
                                      .U8(3)
                                      .F64({0.5})
                                      .U64(2)
                                      .U32(1)
                                      .U32(0)
                                      .U32(2)
                                      .U32(0)
                                      .U64(2)
                                      .F64({0, 1, 0, -1, 0, 0, 0, 0, 1, 0, 1, 1})
                                      .U8(255)
                                      .U8(0)
                                      .U8(0)
                                      .F64({-1})
                                      .U64(0)
                                      .text);
  EXPECT_EQ(binary.at("groups2D"), Bytes()
                                       .U64(3)
                                       .U32(1)
                                       .U32(0)
                                       .U8(0)
                                       .U64(1)
                                       .U64(0)
                                       .U64(1)
                                       .U32(0)
                                       .U32(1)
                                       .U32(1)
                                       .U8(1)
                                       .U64(2)
                                       .U64(2)
                                       .U32(0)
                                       .U32(1)
                                       .U64(1)
                                       .U32(0)
                                       .U32(2)
                                       .U32(0)
                                       .U8(1)
                                       .U64(kNoId)
                                       .U64(1)
                                       .U32(0)
                                       .U64(0)
                                       .text);
  EXPECT_EQ(binary.at("groups3D"), Bytes()
                                       .U64(2)
                                       .U64(1)
                                       .U8(0)
                                       .U64(3)
                                       .F64({1, 0, 0})
                                       .U64(0)
                                       .U64(1)
                                       .U64(1)
                                       .U64(1)
                                       .U32(1)
                                       .U32(0)
                                       .U64(2)
                                       .U8(1)
                                       .U64(4)
                                       .F64({0, 0, 1, 0})
                                       .U64(2)
                                       .U64(1)
                                       .U64(2)
                                       .U64(1)
                                       .U64(1)
                                       .U64(1)
                                       .U32(1)
                                       .U32(1)
                                       .text);
  EXPECT_EQ(binary.at("wireframe"), Bytes().U64(2).U64(1).U64(1).U64(2).U64(2).U64(2).U64(1).text);
  EXPECT_EQ(binary.at("relations"), Bytes().U64(1).U64(1).U64(2).U8(0).text);
}

TEST(SideFiles, GroupsOfAnImageMayComeInAnyOrder) {
  Files files = SmallModelText();
  files["groups2D"] = "2 0 PLANE -1 1 0 0\n1 1 PLANE 2 2 0 1 1 0\n\n# between\n1 0 VP 1 0 1 0\n";
  EXPECT_EQ(Fingerprint(ReadFiles(files, ModelFormat::kText)),
            Fingerprint(ReadFiles(SmallModelText(), ModelFormat::kText)));
}

TEST(RoundTrip, RandomModelsSurviveEitherFormatBitForBit) {
  for (uint64_t seed = 0; seed < 30; ++seed) {
    const Reconstruction model =
        RandomModel(seed, {.with_rigs = seed % 2 == 0, .with_structure = seed % 5 != 0});
    for (const ModelFormat format : {ModelFormat::kText, ModelFormat::kBinary}) {
      const Reconstruction again = ReadFiles(WriteFiles(model, format), format);
      EXPECT_EQ(again.FindInconsistency(), std::nullopt);
      EXPECT_EQ(Fingerprint(again), Fingerprint(model)) << "seed " << seed << Extension(format);
    }
  }
}

TEST(RoundTrip, TextToBinaryToTextLosesNothing) {
  for (uint64_t seed = 100; seed < 120; ++seed) {
    const Files text = WriteFiles(RandomModel(seed), ModelFormat::kText);
    const Reconstruction from_text = ReadFiles(text, ModelFormat::kText);
    const Files binary = WriteFiles(from_text, ModelFormat::kBinary);
    const Reconstruction from_binary = ReadFiles(binary, ModelFormat::kBinary);
    EXPECT_EQ(WriteFiles(from_binary, ModelFormat::kText), text);
    EXPECT_EQ(WriteFiles(from_text, ModelFormat::kBinary), binary);
  }
}

TEST(RoundTrip, EveryGroupTypeIsInTheRandomModels) {
  const Reconstruction model = RandomModel(1);
  for (const GroupType* type : AllGroupTypes()) {
    EXPECT_TRUE(std::any_of(model.groups3D.begin(), model.groups3D.end(), [&](const auto& entry) {
      return entry.second.type == type;
    })) << type->name;
  }
}

}  // namespace
}  // namespace holba
