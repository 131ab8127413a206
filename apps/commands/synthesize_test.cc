// SPDX-License-Identifier: BSD-3-Clause
// The commands synthesize and evaluate_poses, one after the other on their files.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>

#include "apps/command.h"
#include "apps/temporary_folder_testing.h"
#include "holba/base/error.h"
#include "holba/evaluation/pose_auc.h"
#include "holba/io/database.h"
#include "holba/io/model_io.h"
#include "holba/synthetic/bundle_problem.h"
#include "holba/synthetic/photo_set.h"

namespace holba {
namespace {

namespace fs = std::filesystem;

// What the command prints.
std::string RunCommand(const std::string& name, const std::map<std::string, std::string>& values,
                       bool json = false) {
  const Command* command = FindCommand(name);
  EXPECT_NE(command, nullptr) << name;
  const std::unique_ptr<Job> job = command->make_job();
  OptionTable table;
  table.Bind(job.get());
  size_t num_set = 0;
  for (const Option& option : table.options()) {
    if (const auto it = values.find(option.name); it != values.end()) {
      option.SetText(it->second);
      ++num_set;
    }
  }
  EXPECT_EQ(num_set, values.size());
  ::testing::internal::CaptureStdout();
  try {
    job->Run({.json = json});
  } catch (...) {
    ::testing::internal::GetCapturedStdout();
    throw;
  }
  return ::testing::internal::GetCapturedStdout();
}

std::map<std::string, std::string> Bytes(const fs::path& folder) {
  std::map<std::string, std::string> bytes;
  for (const auto& entry : fs::directory_iterator(folder)) {
    std::ifstream file(entry.path(), std::ios::binary);
    bytes[entry.path().filename().string()] = {std::istreambuf_iterator<char>(file), {}};
  }
  return bytes;
}

using SynthesizeCommand = TemporaryFolderTest;

TEST_F(SynthesizeCommand, WritesTheProblemOfTheLibraryInBothFormats) {
  const SyntheticProblem problem =
      MakeBundleProblem({.seed = 3, .num_images = 20, .vps = true, .rig_size = 2});
  for (const char* type : {"txt", "bin"}) {
    const fs::path folder = folder_ / type;
    RunCommand("synthesize", {{"output_path", folder.string()},
                              {"output_type", type},
                              {"seed", "3"},
                              {"num_images", "20"},
                              {"vps", "1"},
                              {"rig_size", "2"}});
    for (const auto& [name, expected] :
         {std::pair("truth", &problem.truth), std::pair("perturbed", &problem.perturbed)}) {
      const Reconstruction model = ReadModel(folder / name);
      EXPECT_EQ(model.FindInconsistency(), std::nullopt);
      EXPECT_TRUE(model.has_rig_files);
      EXPECT_EQ(model.relations.size(), expected->relations.size());
      EXPECT_EQ(model.wireframe.size(), 60);
      ASSERT_EQ(model.points3D.size(), 200);
      for (const auto& [id, point] : expected->points3D) {
        EXPECT_EQ(model.points3D.at(id).xyz, point.xyz);
      }
      for (const auto& [id, group] : expected->groups3D) {
        EXPECT_EQ(model.groups3D.at(id).params, group.params);
      }
    }
  }
}

TEST_F(SynthesizeCommand, WritesTheSameBytesForTheSameSeed) {
  for (const char* name : {"a", "b"}) {
    RunCommand("synthesize", {{"output_path", (folder_ / name).string()}, {"num_images", "20"}});
  }
  for (const char* model : {"truth", "perturbed"}) {
    const auto bytes = Bytes(folder_ / "a" / model);
    EXPECT_GE(bytes.size(), 9);
    EXPECT_TRUE(bytes == Bytes(folder_ / "b" / model)) << model;
  }
}

TEST_F(SynthesizeCommand, MakesWhatEvaluatePosesMeasures) {
  RunCommand("synthesize", {{"output_path", folder_.string()}, {"num_images", "20"}});
  const std::string truth = (folder_ / "truth").string();
  const std::string perturbed = (folder_ / "perturbed").string();
  const PoseErrors errors = ComparePoses(ReadModel(perturbed), ReadModel(truth));
  const auto json = nlohmann::json::parse(RunCommand(
      "evaluate_poses",
      {{"input_path", perturbed}, {"ground_truth_path", truth}, {"thresholds_deg", "0.5,3,10"}},
      true));
  EXPECT_EQ(json["registered"], 20);
  EXPECT_EQ(json["images"], 20);
  ASSERT_EQ(json["auc"].size(), 3);
  EXPECT_NEAR(json["auc"]["0.5"].get<double>(), 100 * PoseAuc(errors.pair_deg, 0.5), 1e-9);
  EXPECT_NEAR(json["auc"]["3"].get<double>(), 100 * PoseAuc(errors.pair_deg, 3.0), 1e-9);
  EXPECT_GT(json["auc"]["10"].get<double>(), 50);
  EXPECT_GT(json["rotation_deg"]["median"].get<double>(), 0.5);

  const std::string table =
      RunCommand("evaluate_poses", {{"input_path", truth}, {"ground_truth_path", truth}});
  EXPECT_THAT(table, ::testing::HasSubstr("20 of 20 images, 190 of 190 pairs"));
  EXPECT_THAT(table, ::testing::HasSubstr("@1 100.00"));
}

TEST_F(SynthesizeCommand, LetsEvaluatePosesTakeTheLargestOfSeveralModels) {
  RunCommand("synthesize", {{"output_path", folder_.string()}, {"num_images", "20"}});
  const std::string truth = (folder_ / "truth").string();
  Reconstruction part = ReadModel(truth);
  // A COLMAP model without structure and with half of the images.
  part.images.RemoveIf([](image_t id, const Image&) { return id > 10; });
  part.frames.RemoveIf([](frame_t id, const Frame&) { return id > 10; });
  part.points3D = {};
  part.lines3D = {};
  part.groups3D = {};
  part.wireframe.clear();
  for (auto& [id, image] : part.images) {
    image.points2D.clear();
    image.lines2D.clear();
    image.groups2D.clear();
  }
  WriteModel(part, folder_ / "models" / "0", ModelFormat::kBinary);
  fs::copy(truth, folder_ / "models" / "1");
  const auto evaluate = [&](const fs::path& input) {
    return nlohmann::json::parse(RunCommand(
        "evaluate_poses", {{"input_path", input.string()}, {"ground_truth_path", truth}}, true));
  };
  EXPECT_EQ(evaluate(folder_ / "models" / "0")["registered"], 10);
  EXPECT_EQ(evaluate(folder_ / "models")["registered"], 20);
  EXPECT_THROW(evaluate(folder_ / "none"), InputError);
}

TEST_F(SynthesizeCommand, WritesADatabaseAndItsTruth) {
  const fs::path database_path = folder_ / "new" / "a.db";
  const std::map<std::string, std::string> options = {{"database_path", database_path.string()},
                                                      {"output_path", (folder_ / "truth").string()},
                                                      {"seed", "2"},
                                                      {"num_images", "50"},
                                                      {"Database.scene", "collection"}};
  RunCommand("synthesize", options);
  PhotoSetOptions photos;
  photos.scene = PhotoSceneKind::kCollection;
  photos.seed = 2;
  photos.num_images = 50;
  const PhotoSet set = MakePhotoSet(photos);
  EXPECT_EQ(ReadModel(folder_ / "truth").points3D.size(), set.truth.points3D.size());
  EXPECT_EQ(Database(database_path).VerifiedPairs(1).size(), set.pairs.size());
  EXPECT_FALSE(fs::exists(database_path.string() + "-wal"));
  // One that is there is not added to.
  EXPECT_THAT([&] { RunCommand("synthesize", options); },
              ::testing::ThrowsMessage<InputError>(::testing::HasSubstr("without images")));
}

TEST_F(SynthesizeCommand, OptionsOfADatabaseAndOfAdjustmentProblemsDoNotMix) {
  using ::testing::HasSubstr;
  const std::string path = (folder_ / "a").string();
  EXPECT_THAT([&] { RunCommand("synthesize", {{"database_path", path}, {"vps", "1"}}); },
              ::testing::ThrowsMessage<InputError>(HasSubstr("--database_path")));
  for (const auto& [name, value] : std::map<std::string, std::string>{
           {"Database.scene", "sphere"}, {"Database.wrong_pairs", "0.1"}}) {
    EXPECT_THAT([&] { RunCommand("synthesize", {{"output_path", path}, {name, value}}); },
                ::testing::ThrowsMessage<InputError>(HasSubstr("--Database.*")));
  }
  EXPECT_FALSE(fs::exists(path));
}

}  // namespace
}  // namespace holba
