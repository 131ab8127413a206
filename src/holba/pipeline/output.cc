// SPDX-License-Identifier: BSD-3-Clause
#include "holba/pipeline/output.h"

#include <algorithm>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "holba/base/progress.h"
#include "holba/base/threads.h"
#include "holba/frontend/drawing/pictures.h"
#include "holba/frontend/drawing/scene_pictures.h"
#include "holba/frontend/photographs/photograph.h"
#include "holba/frontend/photographs/shrink.h"
#include "holba/io/files.h"
#include "holba/io/ply.h"

namespace holba {
namespace fs = std::filesystem;
namespace {

constexpr int kTopViewPx = 1200;
// Of the longer side of pictures of the scene: the breadth of a page at 220 dots an inch.
constexpr int kScenePictureSidePx = 1600;
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

void StageScenePictures(const Reconstruction& model, const std::string& unit, int num_threads,
                        const std::string& prefix, StagedFolder* stage) {
  fs::create_directories(stage->path() / prefix);
  const std::vector<SceneView> views = MakeSceneViews(model, kScenePictureSidePx);
  Progress progress("Drawing", "pictures", views.size());
  for (const SceneView& view : views) {
    WriteImage(DrawScene(model, view, {.unit = unit, .num_threads = num_threads}),
               stage->path() / prefix / (view.name + ".png"));
    progress.Advance();
  }
}

void StageImagePictures(const Reconstruction& model, const PhotographFolder& image_path,
                        const std::set<image_t>& without_photograph, int num_pictures,
                        PictureFormat format, int num_threads, const std::string& prefix,
                        StagedFolder* stage) {
  std::vector<size_t> shown;  // indices of images
  for (size_t i = 0; i < model.images.size(); ++i) {
    if (!without_photograph.contains((model.images.begin() + i)->first)) shown.push_back(i);
  }
  const size_t num_images = shown.size();
  const size_t count =
      num_pictures < 0 ? num_images : std::min(num_images, static_cast<size_t>(num_pictures));
  const fs::path folder = stage->path() / prefix;
  fs::create_directories(folder);
  const std::vector<std::string> stems = FlatStems(model);
  const std::string ending = format == PictureFormat::kPng ? ".png" : ".jpg";
  Progress progress("Drawing", "photographs", count);
  ParallelTasks(num_threads, count, [&](size_t i) {
    const size_t image_idx = shown[i * num_images / count];
    const auto& [image_id, image] = *(model.images.begin() + image_idx);
    const ColourImage photograph = ReadColourImage(image_path / image.name);
    const auto write = [&](const ColourImage& picture, const char* what) {
      WriteImage(picture, folder / (stems[image_idx] + what + ending));
    };
    write(DrawSegments(model, image_id, photograph), "_lines");
    write(DrawGroups(model, image_id, photograph), "_groups");
    write(DrawWireframe(model, image_id, photograph), "_wireframe");
    write(DrawSceneInImage(model, image_id, Shrunk(photograph, kScenePictureSidePx), 1), "_model");
    progress.Advance();
  });
}

void StagePictures(const Reconstruction& model, const PhotographFolder& image_path,
                   const std::set<image_t>& without_photograph, int num_pictures, int num_threads,
                   const std::string& prefix, StagedFolder* stage) {
  const std::string folder = prefix + kPictures + "/";
  StageScenePictures(model, "", num_threads, folder, stage);
  WriteImage(DrawTopView(model, kTopViewPx), stage->path() / folder / "top_view.png");
  StageImagePictures(model, image_path, without_photograph, num_pictures, PictureFormat::kJpeg,
                     num_threads, folder, stage);
}

bool IsPly(std::string_view name) { return name == kStructurePly || name == kPointsPly; }
bool IsPictureFolder(std::string_view name) { return name == kPictures || name == kOldStage; }

bool IsScenePicture(std::string_view name) {
  const std::string_view stem = name.substr(0, name.rfind('.'));
  if (!name.ends_with(".png")) return false;
  return stem == "overview" || stem == "plan" || stem == "front" || stem == "side" ||
         stem.starts_with("along_");
}

}  // namespace holba
