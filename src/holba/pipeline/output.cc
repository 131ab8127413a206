// SPDX-License-Identifier: BSD-3-Clause
#include "holba/pipeline/output.h"

#include <algorithm>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "holba/base/threads.h"
#include "holba/frontend/drawing/pictures.h"
#include "holba/frontend/photographs/photograph.h"
#include "holba/io/files.h"
#include "holba/io/ply.h"

namespace holba {
namespace fs = std::filesystem;
namespace {

constexpr int kTopViewPx = 1200;
constexpr const char* kStructurePly = "structure.ply";
constexpr const char* kPointsPly = "points.ply";
constexpr const char* kPictures = "pictures";
constexpr const char* kOldStage = ".pictures.new";

// For each image a name of its own: names of images may have folders, pictures lie side by side.
std::vector<std::string> FlatStems(const Reconstruction& model) {
  std::vector<std::string> stems;
  std::map<std::string, size_t> uses;
  for (const auto& [image_id, image] : model.images) {
    std::string stem = fs::path(image.name).replace_extension().string();
    std::replace(stem.begin(), stem.end(), '/', '_');
    ++uses[stem];
    stems.push_back(std::move(stem));
  }
  for (size_t i = 0; i < stems.size(); ++i) {
    if (uses[stems[i]] > 1) stems[i] += "_" + std::to_string((model.images.begin() + i)->first);
  }
  return stems;
}

}  // namespace

void StageStructurePly(const Reconstruction& model, const std::string& prefix,
                       StagedFolder* stage) {
  const auto write = [&](const char* name, const PlyContent& content) {
    stage->Write(prefix + name, [&](std::ostream* stream) { FormatPly(model, content, stream); });
  };
  write(kStructurePly, {.points = false, .lines = true, .groups = true});
  write(kPointsPly, {.points = true, .lines = false, .groups = false});
}

void StagePictures(const Reconstruction& model, const PhotographFolder& image_path,
                   const std::set<image_t>& without_photograph, int num_pictures, int num_threads,
                   const std::string& prefix, StagedFolder* stage) {
  std::vector<size_t> shown;  // indices of images
  for (size_t i = 0; i < model.images.size(); ++i) {
    if (!without_photograph.contains((model.images.begin() + i)->first)) shown.push_back(i);
  }
  const size_t num_images = shown.size();
  const size_t count =
      num_pictures < 0 ? num_images : std::min(num_images, static_cast<size_t>(num_pictures));
  const fs::path folder = stage->path() / prefix / kPictures;
  fs::create_directories(folder);
  const std::vector<std::string> stems = FlatStems(model);
  ParallelTasks(num_threads, count + 1, [&](size_t i) {
    if (i == count) {
      WriteImage(DrawTopView(model, kTopViewPx), folder / "top_view.png");
      return;
    }
    const size_t image_idx = shown[i * num_images / count];
    const auto& [image_id, image] = *(model.images.begin() + image_idx);
    const ColourImage photograph = ReadColourImage(image_path / image.name);
    const std::string& stem = stems[image_idx];
    WriteImage(DrawSegments(model, image_id, photograph), folder / (stem + "_lines.jpg"));
    WriteImage(DrawGroups(model, image_id, photograph), folder / (stem + "_groups.jpg"));
    WriteImage(DrawWireframe(model, image_id, photograph), folder / (stem + "_wireframe.jpg"));
  });
}

bool IsPly(std::string_view name) { return name == kStructurePly || name == kPointsPly; }
bool IsPictureFolder(std::string_view name) { return name == kPictures || name == kOldStage; }

}  // namespace holba
