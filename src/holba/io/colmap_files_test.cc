// SPDX-License-Identifier: BSD-3-Clause
#include "holba/io/colmap_files.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "holba/io/test_models.h"

namespace holba {
namespace {

std::string FromHex(std::string_view hex) {
  std::string bytes;
  for (size_t i = 0; i < hex.size(); i += 2) {
    bytes.push_back(static_cast<char>(std::stoi(std::string(hex.substr(i, 2)), nullptr, 16)));
  }
  return bytes;
}

// Built from COLMAP's sources; cameras, images and points3D were read and written back by
// COLMAP 3.8.
Files GoldenBytes(bool with_rigs) {
  Files files = {
      {"cameras",
       FromHex("01000000000000000100000002000000000400000000000000030000000000000000000000009440"
               "000000000000804000000000000078409a9999999999a93f")},
      {"images",
       FromHex(
           "010000000000000001000000000000000000f03f0000000000000000000000000000000000000000"
           "00000000000000000000000000000000000000000000000000001440"
           "01000000612e6a7067000200000000000000000000000020594000000000001069400700000000000000"
           "000000000000f83f0000000000000440ffffffffffffffff")},
      {"points3D",
       FromHex("010000000000000007000000000000009a9999999999b93f9a9999999999c93f333333333333d33f"
               "0a141e000000000000e03f01000000000000000100000000000000")}};
  if (!with_rigs) return files;
  // Camera 2 of the golden rig, as camera 1.
  std::string& cameras = files["cameras"];
  cameras[0] = 2;
  std::string second = cameras.substr(8);
  second[0] = 2;
  cameras += second;
  files["rigs"] = FromHex(
      "010000000000000001000000020000000000000001000000000000000200000001000000000000f03f"
      "0000000000000000000000000000000000000000000000009a9999999999b93f"
      "00000000000000000000000000000000");
  files["frames"] = FromHex(
      "01000000000000000100000001000000000000000000f03f000000000000000000000000000000000000"
      "000000000000000000000000000000000000000000000000000000001440"
      "0100000000000000010000000100000000000000");
  return files;
}

TEST(ColmapFiles, GoldenBytesAreReadAsColmapReadsThem) {
  for (const bool with_rigs : {false, true}) {
    const Reconstruction model = ReadFiles(GoldenBytes(with_rigs), ModelFormat::kBinary);
    EXPECT_EQ(model.FindInconsistency(), std::nullopt);
    EXPECT_EQ(model.has_rig_files, with_rigs);
    const Camera& camera = model.cameras.at(1);
    EXPECT_EQ(camera.model->name, "SIMPLE_RADIAL");
    EXPECT_EQ(camera.width, 1024u);
    EXPECT_EQ(camera.height, 768u);
    EXPECT_THAT(camera.params, testing::ElementsAre(1280.0, 512.0, 384.0, 0.05));
    const Image& image = model.images.at(1);
    EXPECT_EQ(image.name, "a.jpg");
    EXPECT_EQ(image.cam_from_world.translation, Eigen::Vector3d(0, 0, 5));
    EXPECT_EQ(image.cam_from_world.rotation.w(), 1.0);
    ASSERT_EQ(image.points2D.size(), 2u);
    EXPECT_EQ(image.points2D[0].xy, Eigen::Vector2d(100.5, 200.5));
    EXPECT_EQ(image.points2D[0].point3D_id, 7u);
    EXPECT_EQ(image.points2D[1].point3D_id, kNoId);
    const Point3D& point = model.points3D.at(7);
    EXPECT_EQ(point.xyz, Eigen::Vector3d(0.1, 0.2, 0.3));
    EXPECT_THAT(point.rgb, testing::ElementsAre(10, 20, 30));
    EXPECT_EQ(point.error, 0.5);
    ASSERT_EQ(point.track.size(), 1u);
    EXPECT_EQ(model.rigs.at(1).sensors.size(), with_rigs ? 1u : 0u);
    if (with_rigs) {
      EXPECT_EQ(model.rigs.at(1).sensors[0].sensor_from_rig->translation,
                Eigen::Vector3d(0.1, 0, 0));
    }
  }
}

TEST(ColmapFiles, GoldenBytesAreWrittenAsColmapWritesThem) {
  for (const bool with_rigs : {false, true}) {
    const Files golden = GoldenBytes(with_rigs);
    const Files written = WriteFiles(ReadFiles(golden, ModelFormat::kBinary), ModelFormat::kBinary);
    for (const auto& [name, bytes] : golden) EXPECT_EQ(written.at(name), bytes) << name;
  }
}

TEST(ColmapFiles, TextHasColmapsHeadersAndNumbers) {
  const Files written =
      WriteFiles(ReadFiles(SmallModelText(), ModelFormat::kText), ModelFormat::kText);
  for (const auto& [name, text] : SmallModelText()) EXPECT_EQ(written.at(name), text) << name;
  const Files golden =
      WriteFiles(ReadFiles(GoldenBytes(false), ModelFormat::kBinary), ModelFormat::kText);
  EXPECT_THAT(golden.at("cameras"),
              testing::EndsWith("\n1 SIMPLE_RADIAL 1024 768 1280 512 384 0.050000000000000003\n"));
}

TEST(ColmapFiles, ImageNamesAreTheRestOfTheLine) {
  const Reconstruction model = ReadFiles(SmallModelText(), ModelFormat::kText);
  EXPECT_EQ(model.images.at(1).name, "left one.jpg");
  EXPECT_TRUE(model.images.at(3).points2D.empty());
}

TEST(ColmapFiles, TextMayHaveBlankLinesTabsAndCarriageReturns) {
  Files files = SmallModelText();
  files["cameras"] =
      "\xEF\xBB\xBF\r\n  \n# x\r\n\t1\tPINHOLE  640 480 +5e2 500.0 320 240 \r\n"
      "2 SIMPLE_RADIAL 640 480 500 320 240 .25";
  files["images"] =
      "1 1 0 0 0 0 0 5 1 left one.jpg \r\n10 20 1 30 40 2 50 60 -1\r\n\r\n"
      "2 1 0 0 0 0.5 0 5 2 right.jpg\r\n11 21 1 31 41 2\r\n3 1 0 0 0 1 0 5 1 c.jpg\r\n\r\n";
  EXPECT_EQ(Fingerprint(ReadFiles(files, ModelFormat::kText)),
            Fingerprint(ReadFiles(SmallModelText(), ModelFormat::kText)));
}

TEST(ColmapFiles, TheImageLinePairIsKeptForImagesWithoutPoints) {
  Files files = SmallModelText();
  for (const char* name : {"points3D", "lines2D", "lines3D", "groups2D", "groups3D", "wireframe",
                           "relations", "rigs", "frames"}) {
    files.erase(name);
  }
  files["images"] = "1 1 0 0 0 0 0 5 1 a.jpg\n\n2 1 0 0 0 0.5 0 5 2 b.jpg\n\n";
  const Reconstruction model = ReadFiles(files, ModelFormat::kText);
  ASSERT_EQ(model.images.size(), 2u);
  const std::string text = WriteFiles(model, ModelFormat::kText).at("images");
  EXPECT_THAT(text, testing::EndsWith(files["images"]));
}

TEST(ColmapFiles, WithFramesTheImageFilesPoseIsIgnoredUnlessItAgrees) {
  Files files = SmallModelText();
  std::string& images = files["images"];
  const std::string stated = "0.5 0 5 2 right.jpg";
  images.replace(images.find(stated), stated.size(), "7.5 0 5 2 right.jpg");
  EXPECT_EQ(ReadFiles(files, ModelFormat::kText).images.at(2).cam_from_world.translation,
            Eigen::Vector3d(0.5, 0, 5));
  const std::string off = "7.5 0 5 2 right.jpg";
  images.replace(images.find(off), off.size(), "0.50000000000001 0 5 2 right.jpg");
  EXPECT_EQ(ReadFiles(files, ModelFormat::kText).images.at(2).cam_from_world.translation.x(),
            0.50000000000001);
  // The opposite quaternion is the same rotation.
  images.replace(images.find("\n2 1 0 0 0"), 10, "\n2 -1 0 0 0");
  EXPECT_EQ(ReadFiles(files, ModelFormat::kText).images.at(2).cam_from_world.rotation.w(), -1.0);
}

// Found by fuzzing: the reader took it, the writer refused it.
TEST(ColmapFiles, ANameMayHoldACarriageReturn) {
  Reconstruction model = ReadFiles(SmallModelText(), ModelFormat::kText);
  model.images.at(2).name = "a\rb.jpg";
  const Files text = WriteFiles(model, ModelFormat::kText);
  EXPECT_EQ(ReadFiles(text, ModelFormat::kText).images.at(2).name, "a\rb.jpg");
}

TEST(ColmapFiles, NamesThatTextCannotHoldAreRefusedThereOnly) {
  for (const std::string name : {" a.jpg", "a.jpg ", "a\nb.jpg", "a\r"}) {
    Reconstruction model = ReadFiles(SmallModelText(), ModelFormat::kText);
    model.images.at(2).name = name;
    const Files binary = WriteFiles(model, ModelFormat::kBinary);
    EXPECT_EQ(ReadFiles(binary, ModelFormat::kBinary).images.at(2).name, name);
    EXPECT_THROW(WriteFiles(model, ModelFormat::kText), InputError);
  }
}

}  // namespace
}  // namespace holba
