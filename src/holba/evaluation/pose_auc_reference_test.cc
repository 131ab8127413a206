// SPDX-License-Identifier: BSD-3-Clause
// The pose AUC against an independent implementation (pose_auc.py beside the real image sets, which
// are not part of the project): HOLBA_DATA_DIR names their folder, HOLBA_PYTHON a Python with numpy.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include "holba/base/data_testing.h"
#include "holba/evaluation/pose_auc.h"
#include "holba/evaluation/statistics.h"

namespace holba {
namespace {

namespace fs = std::filesystem;

std::string Output(const std::string& command) {
  std::string output;
  FILE* pipe = popen((command + " 2>/dev/null").c_str(), "r");
  if (pipe == nullptr) return output;
  char buffer[4096];
  while (const size_t n = std::fread(buffer, 1, sizeof buffer, pipe)) output.append(buffer, n);
  pclose(pipe);
  return output;
}

// Empty: none has numpy.
std::string PythonWithNumpy() {
  std::vector<std::string> candidates{"python3", "/usr/bin/python3"};
  if (const char* python = std::getenv("HOLBA_PYTHON"))
    candidates.insert(candidates.begin(), python);
  for (const std::string& python : candidates) {
    if (Output(python + " -c 'import numpy; print(7)'") == "7\n") return python;
  }
  return "";
}

// Poses only.
Reconstruction ReadImagesText(const fs::path& path) {
  Reconstruction model;
  std::ifstream file(path);
  std::string text;
  while (std::getline(file, text)) {
    if (text.starts_with('#')) continue;
    std::istringstream fields(text);
    image_t id;
    Image image;
    Rigid3d& pose = image.cam_from_world;
    fields >> id >> pose.rotation.w() >> pose.rotation.x() >> pose.rotation.y() >>
        pose.rotation.z() >> pose.translation.x() >> pose.translation.y() >> pose.translation.z() >>
        image.camera_id >> image.name;
    EXPECT_TRUE(fields) << path << ": " << text.substr(0, 80);
    EXPECT_TRUE(model.images.Add(id, image));
    std::getline(file, text);  // the 2D points
  }
  return model;
}

// Without rounding, as JSON-free lines: registered, medians, then AUC and trapezoid AUC for each
// threshold.
constexpr const char* kScript = R"(
import sys
sys.dont_write_bytecode = True
data, gt_path, model_path, drop = sys.argv[1:5]
sys.path.insert(0, data)
import numpy as np
import pose_auc as p
gt = p.read_images(gt_path)
poses = p.read_images(model_path)
for name in sorted(poses)[:int(drop)]:
    del poses[name]
model = {g: poses[n] for g, n in p.match_names(gt, poses).items()}
rot, tra, err = p.pair_errors(gt, model)
ok = np.isfinite(err)
print(len(model), repr(float(np.median(rot[ok]))), repr(float(np.median(tra[ok]))))
for t in (0.5, 1, 3, 5, 10):
    print(repr(p.auc(err, t)), repr(p.auc_trapezoid(err, t)))
)";

class PoseAucReference : public ::testing::TestWithParam<std::string> {};

TEST_P(PoseAucReference, AgreesOnRealModels) {
  const fs::path data = DataFolder();
  const fs::path gt = data / GetParam() / "gt" / "images.txt";
  const fs::path model_path = data / GetParam() / "holistic" / "images.txt";
  if (!fs::exists(gt) || !fs::exists(model_path)) {
    GTEST_SKIP() << "SKIPPED, NOT TESTED: no real models under " << data << " (set HOLBA_DATA_DIR)";
  }
  const std::string python = PythonWithNumpy();
  if (python.empty()) {
    GTEST_SKIP() << "SKIPPED, NOT TESTED: no python3 with numpy (set HOLBA_PYTHON)";
  }
  const fs::path script = fs::path(::testing::TempDir()) / ("pose_auc_" + GetParam() + ".py");
  std::ofstream(script) << kScript;
  const Reconstruction truth = ReadImagesText(gt);
  for (const int num_dropped : {0, 3}) {
    SCOPED_TRACE(num_dropped);
    Reconstruction model = ReadImagesText(model_path);
    std::vector<std::string> names;
    for (const auto& [id, image] : model.images) names.push_back(image.name);
    std::sort(names.begin(), names.end());
    names.resize(num_dropped);
    model.images.RemoveIf([&](image_t, const Image& image) {
      return std::find(names.begin(), names.end(), image.name) != names.end();
    });
    std::istringstream expected(Output(python + " " + script.string() + " " + data.string() + " " +
                                       gt.string() + " " + model_path.string() + " " +
                                       std::to_string(num_dropped)));
    size_t registered;
    double rotation_median, translation_median;
    ASSERT_TRUE(expected >> registered >> rotation_median >> translation_median);

    const PoseErrors errors = ComparePoses(model, truth);
    EXPECT_EQ(errors.registered, registered);
    std::vector<double> rotations, translations;
    for (size_t i = 0; i < errors.pair_deg.size(); ++i) {
      if (std::isinf(errors.pair_deg[i])) continue;
      rotations.push_back(errors.rotation_deg[i]);
      translations.push_back(errors.translation_deg[i]);
    }
    EXPECT_NEAR(Summarise(rotations)->median, rotation_median, 1e-6);
    EXPECT_NEAR(Summarise(translations)->median, translation_median, 1e-6);
    for (const double threshold : {0.5, 1.0, 3.0, 5.0, 10.0}) {
      double step, trapezoid;
      ASSERT_TRUE(expected >> step >> trapezoid);
      EXPECT_NEAR(PoseAuc(errors.pair_deg, threshold), step, 1e-6);
      EXPECT_NEAR(PoseAuc(errors.pair_deg, threshold, AucConvention::kTrapezoid), trapezoid, 1e-6);
    }
  }
  fs::remove(script);
}

INSTANTIATE_TEST_SUITE_P(Sets, PoseAucReference,
                         ::testing::Values("entry_p10", "fountain_p11", "herzjesu_p8",
                                           "herzjesu_p25", "southbuilding26", "redkitchen40"),
                         [](const auto& info) { return info.param; });

}  // namespace
}  // namespace holba
