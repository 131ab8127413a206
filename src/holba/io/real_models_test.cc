// SPDX-License-Identifier: BSD-3-Clause
// Real models, and COLMAP itself as the judge of what we write.
#include "holba/base/data_testing.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>

#include "holba/io/model_io.h"
#include "holba/io/test_models.h"
#include "holba/scene/random_model.h"

namespace holba {
namespace {

namespace fs = std::filesystem;

std::vector<fs::path> RealModels() {
  std::vector<fs::path> models;
  for (const auto& entry : fs::recursive_directory_iterator(DataFolder())) {
    if (entry.is_directory() && FindModelFormat(entry.path())) models.push_back(entry.path());
  }
  std::sort(models.begin(), models.end());
  return models;
}

// Models of other programs and inputs of reported faults, some of which contradict themselves.
bool MayBeRefused(const fs::path& path) {
  const std::string folder = fs::relative(path, DataFolder()).begin()->string();
  return folder == "models_other" || folder == "reports";
}

// Without comments: they hold ratios that others write with fewer digits.
std::string Records(const std::string& bytes) {
  if (!bytes.starts_with('#')) return bytes;
  std::istringstream lines(bytes);
  std::string records, line;
  while (std::getline(lines, line)) {
    if (!line.starts_with('#')) records += line + '\n';
  }
  return records;
}

TEST(RealModels, AreConsistentAndSurviveBothFormatsBitForBit) {
  HOLBA_SKIP_WITHOUT_DATA();
  size_t num_holistic = 0;
  const std::vector<fs::path> models = RealModels();
  EXPECT_GE(models.size(), 20u);
  for (const fs::path& path : models) {
    SCOPED_TRACE(path.string());
    Reconstruction model;
    try {
      model = ReadModel(path);
    } catch (const InputError& error) {
      EXPECT_TRUE(MayBeRefused(path)) << error.what();
      EXPECT_THAT(error.what(), testing::HasSubstr(path.string()));
      continue;
    }
    EXPECT_EQ(model.FindInconsistency(), std::nullopt);
    EXPECT_TRUE(!model.images.empty() || MayBeRefused(path));
    num_holistic += model.lines3D.empty() ? 0 : 1;
    const std::string fingerprint = Fingerprint(model);
    const TestFolder folder;
    for (const ModelFormat format : {ModelFormat::kText, ModelFormat::kBinary}) {
      WriteModel(model, folder / "m", format);
      EXPECT_TRUE(Fingerprint(ReadModel(folder / "m")) == fingerprint);
    }
    // What COLMAP wrote in binary, and the study of FORMAT.md in text, comes out byte for byte, but
    // for comments.
    const ModelFormat format = *FindModelFormat(path);
    if ((format == ModelFormat::kText && path.filename() != "holistic") || MayBeRefused(path)) continue;
    WriteModel(model, folder / "m", format);
    for (const std::string& name : ListFolder(folder / "m")) {
      if (name == "holistic.json") continue;  // JSON may be spelt in many ways
      EXPECT_TRUE(Records(ReadFileBytes(folder / "m" / name)) ==
                  Records(ReadFileBytes(path / name)))
          << name;
    }
  }
  EXPECT_EQ(num_holistic, 6u);
}

TEST(RealModels, HaveTheSizesThatTheirReadmeStates) {
  HOLBA_SKIP_WITHOUT_DATA();
  const Reconstruction model = ReadModel(DataFolder() / "entry_p10" / "holistic");
  EXPECT_EQ(model.images.size(), 10u);
  EXPECT_EQ(model.points3D.size(), 3999u);
  EXPECT_EQ(model.lines3D.size(), 532u);
  EXPECT_EQ(model.wireframe.size(), 180u);
  EXPECT_EQ(model.relations.size(), 5u);
  size_t num_segments = 0, num_vps = 0, num_planes = 0;
  for (const auto& [id, image] : model.images) num_segments += image.lines2D.size();
  for (const auto& [id, group] : model.groups3D) {
    (group.type->name == "VP" ? num_vps : num_planes) += 1;
  }
  EXPECT_EQ(num_segments, 7543u);
  EXPECT_EQ(num_vps, 2u);
  EXPECT_EQ(num_planes, 6u);
}

bool RunShell(const std::string& command) { return std::system(command.c_str()) == 0; }
bool HasColmap() { return RunShell("command -v colmap >/dev/null 2>&1"); }

// Runs COLMAP's model_converter; false if it fails.
bool Convert(const fs::path& input, const fs::path& output, const std::string& type) {
  fs::create_directories(output);
  return RunShell("QT_QPA_PLATFORM=offscreen colmap model_converter --input_path '" +
                  input.string() + "' --output_path '" + output.string() + "' --output_type " +
                  type + " >'" + output.string() + ".log' 2>&1");
}

// Equal but for the last bits (COLMAP normalises quaternions) and the order of records.
void ExpectSameColmapModel(const Reconstruction& a, const Reconstruction& b) {
  ASSERT_EQ(a.cameras.size(), b.cameras.size());
  ASSERT_EQ(a.images.size(), b.images.size());
  ASSERT_EQ(a.points3D.size(), b.points3D.size());
  for (const auto& [id, camera] : a.cameras) {
    const Camera* other = b.cameras.Find(id);
    ASSERT_NE(other, nullptr);
    EXPECT_EQ(camera.model, other->model);
    EXPECT_EQ(camera.width, other->width);
    EXPECT_EQ(camera.height, other->height);
    EXPECT_EQ(camera.params, other->params);
  }
  for (const auto& [id, image] : a.images) {
    const Image* other = b.images.Find(id);
    ASSERT_NE(other, nullptr);
    EXPECT_EQ(image.name, other->name);
    EXPECT_EQ(image.camera_id, other->camera_id);
    EXPECT_EQ(image.cam_from_world.translation, other->cam_from_world.translation);
    EXPECT_LT(
        (image.cam_from_world.rotation.coeffs() - other->cam_from_world.rotation.coeffs()).norm(),
        1e-14);
    ASSERT_EQ(image.points2D.size(), other->points2D.size());
    for (size_t i = 0; i < image.points2D.size(); ++i) {
      EXPECT_EQ(image.points2D[i].xy, other->points2D[i].xy);
      EXPECT_EQ(image.points2D[i].point3D_id, other->points2D[i].point3D_id);
    }
  }
  for (const auto& [id, point] : a.points3D) {
    const Point3D* other = b.points3D.Find(id);
    ASSERT_NE(other, nullptr);
    EXPECT_EQ(point.xyz, other->xyz);
    EXPECT_EQ(point.rgb, other->rgb);
    EXPECT_EQ(point.error, other->error);
    ASSERT_EQ(point.track.size(), other->track.size());
    for (size_t i = 0; i < point.track.size(); ++i) {
      EXPECT_EQ(point.track[i].image_id, other->track[i].image_id);
      EXPECT_EQ(point.track[i].point2D_idx, other->track[i].point2D_idx);
    }
  }
}

#define SKIP_WITHOUT_COLMAP() \
  if (!HasColmap())           \
  GTEST_SKIP() << "the program colmap is not installed: nothing was compared with it"

// COLMAP 3.8 knows the first eleven models only.
Reconstruction ModelForOldColmap(uint64_t seed, bool with_rigs) {
  Reconstruction model = RandomModel(seed, {.with_rigs = with_rigs, .extreme_reals = false});
  for (auto& [id, camera] : model.cameras) {
    if (camera.model->id <= 10) continue;
    camera.model = FindCameraModel("SIMPLE_RADIAL");
    camera.params.resize(4, 1.0);
  }
  int i = 0;
  for (auto& [id, image] : model.images) image.name = std::to_string(++i) + ".jpg";
  return model;
}

TEST(Colmap, ReadsWhatWeWriteInBothFormatsWithRigsAndSideFilesBeside) {
  SKIP_WITHOUT_COLMAP();
  for (const bool with_rigs : {false, true}) {
    const TestFolder folder;
    const Reconstruction model = ModelForOldColmap(with_rigs ? 11 : 12, with_rigs);
    WriteModel(model, folder / "bin", ModelFormat::kBinary);
    WriteModel(model, folder / "txt", ModelFormat::kText);
    EXPECT_EQ(fs::exists(folder / "bin" / "rigs.bin"), with_rigs);
    EXPECT_TRUE(fs::exists(folder / "bin" / "lines3D.bin"));
    ASSERT_TRUE(Convert(folder / "bin", folder / "bin_to_txt", "TXT"));
    ASSERT_TRUE(Convert(folder / "txt", folder / "txt_to_bin", "BIN"));
    ExpectSameColmapModel(model, ReadModel(folder / "bin_to_txt"));
    ExpectSameColmapModel(model, ReadModel(folder / "txt_to_bin"));
    EXPECT_TRUE(RunShell("QT_QPA_PLATFORM=offscreen colmap model_analyzer --path '" +
                         (folder / "bin").string() + "' >'" + (folder / "log").string() +
                         "' 2>&1"));
  }
}

TEST(Colmap, ReadsNamesWithBlanksInBinary) {
  SKIP_WITHOUT_COLMAP();
  const TestFolder folder;
  Reconstruction model = ModelForOldColmap(13, false);
  model.images.begin()->second.name = "a folder/the  image.jpg";
  WriteModel(model, folder / "bin", ModelFormat::kBinary);
  ASSERT_TRUE(Convert(folder / "bin", folder / "txt", "TXT"));
  ExpectSameColmapModel(model, ReadModel(folder / "txt"));
}

TEST(Colmap, ReadsRealHolisticModelsAsWeWriteThem) {
  SKIP_WITHOUT_COLMAP();
  HOLBA_SKIP_WITHOUT_DATA();
  const TestFolder folder;
  const Reconstruction model = ReadModel(DataFolder() / "herzjesu_p8" / "holistic");
  WriteModel(model, folder / "bin", ModelFormat::kBinary);
  ASSERT_TRUE(Convert(folder / "bin", folder / "txt", "TXT"));
  ExpectSameColmapModel(model, ReadModel(folder / "txt"));
}

}  // namespace
}  // namespace holba
