// SPDX-License-Identifier: BSD-3-Clause
#include "holba/io/model_io.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "holba/base/check.h"
#include "holba/io/holistic_json.h"
#include "holba/io/test_models.h"
#include "holba/scene/random_model.h"

namespace holba {
namespace {

namespace fs = std::filesystem;
using testing::ElementsAre;
using testing::HasSubstr;

void WriteSmallModel(const fs::path& folder) {
  for (const auto& [name, text] : SmallModelText()) WriteBytes(folder / (name + ".txt"), text);
  WriteBytes(folder / "holistic.json", kSmallModelJson);
}

std::string MessageOfReading(const fs::path& folder) {
  try {
    ReadModel(folder);
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

TEST(ModelIo, AFolderIsWrittenAndReadInEitherFormat) {
  const TestFolder folder;
  for (uint64_t seed = 0; seed < 6; ++seed) {
    const Reconstruction model =
        RandomModel(seed, {.with_rigs = seed % 2 == 0, .with_structure = seed % 3 != 0});
    for (const ModelFormat format : {ModelFormat::kText, ModelFormat::kBinary}) {
      const fs::path path = folder / "new" / std::to_string(seed) / Extension(format);
      WriteModel(model, path, format);
      EXPECT_EQ(Fingerprint(ReadModel(path)), Fingerprint(model));
      EXPECT_EQ(FindModelFormat(path), format);
    }
  }
}

TEST(ModelIo, ImagesWithoutAPoseAndOriginsOfPointsSurvive) {
  for (const bool with_rigs : {false, true}) {
    const TestFolder folder;
    Reconstruction model = RandomModel(3, {.with_rigs = with_rigs, .with_unregistered = true});
    if (with_rigs) model.DeregisterFrame(model.frames.begin()[0].first);
    for (const ModelFormat format : {ModelFormat::kText, ModelFormat::kBinary}) {
      WriteModel(model, folder / "m", format);
      const Reconstruction read = ReadModel(folder / "m");
      EXPECT_EQ(Fingerprint(read), Fingerprint(model));
      ASSERT_EQ(read.unregistered_images.size(), model.unregistered_images.size());
      ASSERT_EQ(read.unregistered_frames.size(), model.unregistered_frames.size());
      for (const auto& [id, image] : model.unregistered_images) {
        const Image& other = read.unregistered_images.at(id);
        EXPECT_EQ(other.name, image.name);
        EXPECT_EQ(other.camera_id, image.camera_id);
        ASSERT_EQ(other.points2D.size(), image.points2D.size());
        for (size_t k = 0; k < image.points2D.size(); ++k) EXPECT_EQ(other.points2D[k].xy, image.points2D[k].xy);
        ASSERT_EQ(other.lines2D.size(), image.lines2D.size());
        EXPECT_EQ(other.groups2D.size(), image.groups2D.size());
      }
      for (const auto& [id, point] : model.points3D) EXPECT_EQ(read.points3D.at(id).origin, point.origin);
    }
  }
}

TEST(ModelIo, FilesOfTextAreReproducedAsTheyWere) {
  const TestFolder folder;
  WriteSmallModel(folder / "in");
  WriteModel(ReadModel(folder / "in"), folder / "bin", ModelFormat::kBinary);
  WriteModel(ReadModel(folder / "bin"), folder / "out", ModelFormat::kText);
  ASSERT_EQ(ListFolder(folder / "out"), ListFolder(folder / "in"));
  for (const std::string& name : ListFolder(folder / "in")) {
    EXPECT_EQ(ReadFileBytes(folder / "out" / name), ReadFileBytes(folder / "in" / name)) << name;
  }
}

TEST(ModelIo, APlainColmapModelStaysPlain) {
  const TestFolder folder;
  WriteModel(RandomModel(1, {.with_rigs = false, .with_structure = false}), folder / "m",
             ModelFormat::kBinary);
  EXPECT_THAT(ListFolder(folder / "m"), ElementsAre("cameras.bin", "images.bin", "points3D.bin"));
}

TEST(ModelIo, WritingReplacesTheWholeSetAndKeepsWhatIsNotOurs) {
  const TestFolder folder;
  const fs::path path = folder / "m";
  WriteModel(RandomModel(1), path, ModelFormat::kText);
  WriteBytes(path / "project.ini", "settings");
  WriteBytes(path / "notes" / "a.txt", "note");
  fs::create_symlink("project.ini", path / "link");
  WriteModel(RandomModel(2, {.with_rigs = false, .with_structure = false}), path,
             ModelFormat::kBinary);
  EXPECT_THAT(ListFolder(path), ElementsAre("cameras.bin", "images.bin", "link", "notes",
                                            "points3D.bin", "project.ini"));
  EXPECT_EQ(ReadFileBytes(path / "project.ini"), "settings");
  EXPECT_EQ(ReadFileBytes(path / "notes" / "a.txt"), "note");
  EXPECT_EQ(fs::read_symlink(path / "link"), "project.ini");
  EXPECT_THAT(ListFolder(folder.path()), ElementsAre("m"));  // no stage is left
}

TEST(ModelIo, TheCurrentFolderIsWrittenInPlace) {
  const TestFolder folder;
  const fs::path path = folder / "m", before = fs::current_path();
  WriteModel(RandomModel(1), path, ModelFormat::kText);
  WriteBytes(path / "project.ini", "settings");
  const Reconstruction model = RandomModel(3, {.with_rigs = false});
  fs::current_path(path);
  WriteModel(model, ".", ModelFormat::kBinary);
  const std::string read = Fingerprint(ReadModel("."));
  fs::current_path(before);
  EXPECT_EQ(read, Fingerprint(model));
  EXPECT_EQ(FindModelFormat(path), ModelFormat::kBinary);
  EXPECT_FALSE(fs::exists(path / "cameras.txt"));
  EXPECT_FALSE(fs::exists(path / "rigs.txt"));
  EXPECT_TRUE(fs::exists(path / "project.ini"));
  EXPECT_THAT(ListFolder(folder.path()), ElementsAre("m"));
}

TEST(ModelIo, ANameWithoutAFolderIsOneInTheCurrentFolder) {
  const TestFolder folder;
  const fs::path before = fs::current_path();
  const Reconstruction model = RandomModel(5, {.with_rigs = false});
  fs::current_path(folder.path());
  for (const char* name : {"bare", "slash/"}) WriteModel(model, name, ModelFormat::kBinary);
  WriteFileWhole("file", [](std::ostream* stream) { *stream << "text"; });
  fs::current_path(before);
  EXPECT_THAT(ListFolder(folder.path()), ElementsAre("bare", "file", "slash"));
  EXPECT_EQ(Fingerprint(ReadModel(folder / "bare")), Fingerprint(model));
  EXPECT_EQ(Fingerprint(ReadModel(folder / "slash")), Fingerprint(model));
  EXPECT_EQ(ReadFileBytes(folder / "file"), "text");
}

TEST(ModelIo, ALinkToAFolderStaysALink) {
  const TestFolder folder;
  fs::create_directories(folder / "real");
  fs::create_directory_symlink("real", folder / "link");
  const Reconstruction model = RandomModel(4);
  WriteModel(model, folder / "link/", ModelFormat::kText);
  EXPECT_TRUE(fs::is_symlink(folder / "link"));
  EXPECT_EQ(Fingerprint(ReadModel(folder / "real")), Fingerprint(model));
}

TEST(ModelIo, AFailureLeavesTheOldModel) {
  const TestFolder folder;
  const Reconstruction old = RandomModel(1);
  WriteModel(old, folder / "m", ModelFormat::kText);
  Reconstruction unwritable = RandomModel(2);
  unwritable.images.begin()->second.name = "two\nlines";
  EXPECT_THROW(WriteModel(unwritable, folder / "m", ModelFormat::kText), InputError);
  unwritable.points3D.begin()->second.xyz.x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(WriteModel(unwritable, folder / "m", ModelFormat::kText), CheckError);
  EXPECT_EQ(Fingerprint(ReadModel(folder / "m")), Fingerprint(old));
  EXPECT_THAT(ListFolder(folder.path()), ElementsAre("m"));
  WriteBytes(folder / "file", "x");
  EXPECT_THROW(WriteModel(old, folder / "file", ModelFormat::kText), InputError);
  EXPECT_THROW(WriteModel(old, folder / "file" / "m", ModelFormat::kText), InputError);
}

TEST(ModelIo, BinaryIsReadFirst) {
  const TestFolder folder;
  const Reconstruction binary = RandomModel(2, {.with_rigs = false});
  WriteModel(RandomModel(1, {.with_rigs = false}), folder / "m", ModelFormat::kText);
  WriteModel(binary, folder / "b", ModelFormat::kBinary);
  for (const std::string& name : ListFolder(folder / "b")) {
    fs::copy_file(folder / "b" / name, folder / "m" / name, fs::copy_options::overwrite_existing);
  }
  EXPECT_EQ(Fingerprint(ReadModel(folder / "m")), Fingerprint(binary));
  // Side files may be of the other format than COLMAP's.
  for (const char* name : {"cameras", "images", "points3D", "lines2D", "lines3D"}) {
    fs::remove(folder / "b" / (std::string(name) + ".bin"));
  }
  WriteModel(binary, folder / "t", ModelFormat::kText);
  for (const char* name : {"cameras", "images", "points3D", "lines2D", "lines3D"}) {
    const std::string file = std::string(name) + ".txt";
    fs::copy_file(folder / "t" / file, folder / "b" / file);
  }
  EXPECT_EQ(Fingerprint(ReadModel(folder / "b")), Fingerprint(binary));
}

TEST(ModelIo, WhatIsNoModelIsRefused) {
  const TestFolder folder;
  EXPECT_THAT(MessageOfReading(folder / "none"), HasSubstr("there is no such file or folder"));
  WriteBytes(folder / "file", "x");
  EXPECT_THAT(MessageOfReading(folder / "file"), HasSubstr("expected NUM_CAMERAS"));
  EXPECT_THAT(MessageOfReading(folder.path()), HasSubstr("expected a COLMAP model in this folder"));
  WriteSmallModel(folder / "m");
  fs::rename(folder / "m" / "points3D.txt", folder / "points3D.txt");
  EXPECT_THAT(MessageOfReading(folder / "m"),
              HasSubstr("found cameras.txt and images.txt without points3D.txt; triangulate points "
                        "(colmap point_triangulator), or give an empty points3D.txt"));
  fs::rename(folder / "points3D.txt", folder / "m" / "points3D.txt");
  fs::remove(folder / "m" / "frames.txt");
  EXPECT_THAT(MessageOfReading(folder / "m"),
              HasSubstr("expected rigs.txt and frames.txt both or neither, found rigs.txt only"));
  fs::create_directory(folder / "m" / "frames.txt");
  EXPECT_THAT(MessageOfReading(folder / "m"),
              HasSubstr("frames.txt: expected a file, found a folder or device"));
}

TEST(ModelIo, FilesThatDoNotFitEachOtherNameTheFolder) {
  const TestFolder folder;
  WriteSmallModel(folder / "m");
  WriteBytes(folder / "m" / "wireframe.txt", "1 1 2\n1 1 2\n");
  EXPECT_THAT(
      MessageOfReading(folder / "m"),
      testing::StartsWith(
          (folder / "m").string() +
          ": the files of this model do not fit each other (the wireframe has point 1 on line 1 "
          "twice); perhaps a tool that does not know the side files has changed the model"));
}

TEST(ModelIo, LinksThatOneEndOnlyKnowsAreLeftOutOrListed) {
  const TestFolder folder;
  WriteSmallModel(folder / "m");
  // Point 2, which two images see, was deleted.
  WriteBytes(folder / "m" / "points3D.txt", "1 0 0 0 10 20 30 0.5 1 0 2 0\n");
  for (const char* name : {"groups3D", "groups2D", "wireframe", "relations"}) {
    fs::remove(folder / "m" / (std::string(name) + ".txt"));
  }
  const Reconstruction model = ReadModel(folder / "m");
  EXPECT_EQ(model.points3D.size(), 1u);
  EXPECT_EQ(model.points3D.at(1).track.size(), 2u);
  EXPECT_EQ(model.images.at(1).points2D.size(), 3u);
  EXPECT_EQ(model.images.at(1).points2D[1].point3D_id, kNoId);
  try {
    ReadModel(folder / "m", {.strict = true});
    FAIL() << "a damaged model was accepted";
  } catch (const InputError& error) {
    EXPECT_EQ(
        error.what(),
        (folder / "m").string() +
            ": links between features of images and 3D features that only one of the two knows: 2 "
            "of 6 (2D features that name a missing 3D feature: 2); --strict 0 leaves them out and "
            "uses the rest; they are:\n  point 1 of image 1 names 3D point 2, which is not in the "
            "model\n  point 1 of image 2 names 3D point 2, which is not in the model");
  }
}

TEST(ModelIo, TwoImagesOfOneNameAreRefusedWithTheirIds) {
  const TestFolder folder;
  Files files = SmallModelText();
  std::string& images = files.at("images");
  images.replace(images.find("right.jpg"), 9, "c.jpg");
  WriteSmallModel(folder / "m");
  WriteBytes(folder / "m" / "images.txt", images);
  EXPECT_EQ(MessageOfReading(folder / "m"), (folder / "m").string() +
                                                ": images 2 and 3 have the same name 'c.jpg'; give "
                                                "one of them another, or remove it from the model");
}

TEST(ModelIo, PosesAreReadWithoutPointsAndWithoutCameras) {
  const TestFolder folder;
  WriteSmallModel(folder / "m");
  const Reconstruction whole = ReadModel(folder / "m");
  const auto expect_poses = [&](const Reconstruction& poses) {
    ASSERT_EQ(poses.images.size(), whole.images.size());
    for (const auto& [image_id, image] : whole.images) {
      const Image& other = poses.images.at(image_id);
      EXPECT_EQ(other.name, image.name);
      EXPECT_EQ(other.cam_from_world.translation, image.cam_from_world.translation);
    }
    EXPECT_EQ(poses.FindInconsistency(), std::nullopt);
  };
  EXPECT_EQ(Fingerprint(ReadPoses(folder / "m")), Fingerprint(whole));
  fs::remove(folder / "m" / "points3D.txt");
  EXPECT_TRUE(HoldsPoses(folder / "m"));
  expect_poses(ReadPoses(folder / "m"));
  EXPECT_TRUE(ReadPoses(folder / "m").has_rig_files);
  for (const char* name : {"cameras", "rigs", "frames"})
    fs::remove(folder / "m" / (std::string(name) + ".txt"));
  expect_poses(ReadPoses(folder / "m"));
  fs::remove(folder / "m" / "images.txt");
  EXPECT_FALSE(HoldsPoses(folder / "m"));
  EXPECT_THROW(ReadPoses(folder / "m"), InputError);
}

TEST(ModelIo, ImagesWhoseLastEmptyLineIsMissingAreRead) {
  const TestFolder folder;
  for (const char* end : {"c.jpg\n", "c.jpg"}) {
    WriteSmallModel(folder / "m");
    std::string images = SmallModelText().at("images");
    images.resize(images.rfind("c.jpg"));
    WriteBytes(folder / "m" / "images.txt", images + end);
    const Reconstruction model = ReadModel(folder / "m");
    EXPECT_EQ(model.images.size(), 3u);
    EXPECT_EQ(model.images.at(3).name, "c.jpg");
    EXPECT_TRUE(model.images.at(3).points2D.empty());
  }
}

TEST(ModelIo, QuaternionsOfAnyLengthAreNormalised) {
  const TestFolder folder;
  WriteSmallModel(folder / "m");
  for (const char* name : {"rigs", "frames"})
    fs::remove(folder / "m" / (std::string(name) + ".txt"));
  std::string images = SmallModelText().at("images");
  images.replace(images.find("2 1 0 0 0 0.5"), 9, "2 4 0 3 0");
  WriteBytes(folder / "m" / "images.txt", images);
  fs::remove(folder / "m" / "holistic.json");
  const Eigen::Quaterniond q = ReadModel(folder / "m").images.at(2).cam_from_world.rotation;
  EXPECT_NEAR(q.w(), 0.8, 1e-15);
  EXPECT_NEAR(q.y(), 0.6, 1e-15);
}

TEST(ModelIo, TextInUtf16IsNamedSo) {
  const TestFolder folder;
  WriteSmallModel(folder / "m");
  WriteBytes(folder / "m" / "cameras.txt", std::string("\xFF\xFE#\0", 4));
  EXPECT_THAT(MessageOfReading(folder / "m"), HasSubstr("found UTF-16; save it as UTF-8"));
}

TEST(ModelIo, SideFilesThatNoLongerFitSayTheSameWhateverChanged) {
  // Point 2, line 2 have other ids: the files named first fit each other, the others do not know.
  using Change = std::pair<std::string, std::string>;
  const std::vector<std::map<std::string, std::vector<Change>>> changes = {
      {{"points3D", {{"\n2 ", "\n7 "}}}, {"images", {{"40 2", "40 7"}, {"41 2", "41 7"}}}},
      {{"lines3D", {{"\n2 ", "\n7 "}}}}};
  for (const auto& files : changes) {
    const TestFolder folder;
    WriteSmallModel(folder / "m");
    for (const auto& [name, replacements] : files) {
      std::string text = SmallModelText().at(name);
      for (const auto& [from, to] : replacements) text.replace(text.find(from), from.size(), to);
      WriteBytes(folder / "m" / (name + ".txt"), text);
    }
    EXPECT_THAT(MessageOfReading(folder / "m"), HasSubstr("remove the side files"));
  }
}

TEST(HolisticJson, PosesThatMovedByMoreThanAPercentOfTheSpreadAreRefused) {
  const TestFolder folder;
  const fs::path path = folder / "m";
  WriteSmallModel(path);
  const double spread = FrameOf(ReadModel(path)).spread;
  EXPECT_NEAR(spread, std::sqrt(0.5 / 3.0), 1e-15);
  for (const double factor : {0.009, 0.011}) {
    // As a COLMAP tool would: the COLMAP files move, the others do not know.
    Reconstruction model = ReadFiles(SmallModelText(), ModelFormat::kText);
    Sim3d sim;
    sim.translation = Eigen::Vector3d(0, factor * spread, 0);
    model.Transform(sim);
    const Files moved = WriteFiles(model, ModelFormat::kText);
    for (const char* name : {"images", "frames", "points3D"}) {
      WriteBytes(path / (std::string(name) + ".txt"), moved.at(name));
    }
    const std::string message = MessageOfReading(path);
    if (factor < 0.01) {
      EXPECT_EQ(message, "");
    } else {
      EXPECT_THAT(message, HasSubstr("holistic.json: the side files belong to camera centres"));
      EXPECT_THAT(message, HasSubstr("more than 1 % of the spread off"));
      EXPECT_THAT(message, HasSubstr("remove the side files"));
    }
  }
  fs::remove(path / "holistic.json");
  EXPECT_EQ(MessageOfReading(path), "");  // without it nothing is checked
}

TEST(HolisticJson, ScaleAndNumberOfImagesAreCheckedToo) {
  const Reconstruction model = ReadFiles(SmallModelText(), ModelFormat::kText);
  const ModelFrame stated = ParseHolisticJson(kSmallModelJson, "holistic.json");
  EXPECT_NO_THROW(CheckFrame(stated, FrameOf(model), "holistic.json"));
  ModelFrame scaled = stated;
  scaled.spread *= 1.02;
  EXPECT_THROW(CheckFrame(stated, scaled, "holistic.json"), InputError);
  ModelFrame fewer = stated;
  fewer.num_images = 2;
  EXPECT_THROW(CheckFrame(stated, fewer, "holistic.json"), InputError);
}

TEST(HolisticJson, IsWrittenAsFormatSays) {
  const Reconstruction model = ReadFiles(SmallModelText(), ModelFormat::kText);
  EXPECT_EQ(HolisticJson(FrameOf(model)), kSmallModelJson);
}

TEST(HolisticJson, WhatIsMalformedIsRefused) {
  const std::vector<std::pair<std::string, std::string>> cases = {
      {"", "found no valid JSON"},
      {"{", "found no valid JSON"},
      {"[]", "expected {\"format\": 1"},
      {"{\"format\": 2}", "expected \"format\": 1, found 2"},
      {"{\"format\": \"1\"}", "use the version of this program"},
      {"{\"format\": 1}", "key 'frame' not found"},
      {R"({"format": 1, "frame": {"num_images": -1, "centroid": [0,0,0], "spread": 1}})",
       "num_images"},
      {R"({"format": 1, "frame": {"num_images": 1, "centroid": [0,0], "spread": 1}})", "centroid"},
      {R"({"format": 1, "frame": {"num_images": 1, "centroid": [0,0,"a"], "spread": 1}})",
       "centroid"},
      {R"({"format": 1, "frame": {"num_images": 1, "centroid": [0,0,0], "spread": -1}})",
       "spread of 0 or more"},
      {R"({"format": 1, "frame": {"num_images": 1, "centroid": [0,0,0], "spread": 1e999}})",
       "expected"},
  };
  for (const auto& [json, expected] : cases) {
    try {
      ParseHolisticJson(json, "holistic.json");
      ADD_FAILURE() << json;
    } catch (const InputError& error) {
      EXPECT_THAT(error.what(), HasSubstr(expected)) << json;
      EXPECT_THAT(error.what(), testing::StartsWith("holistic.json: "));
    }
  }
}

}  // namespace
}  // namespace holba
