// SPDX-License-Identifier: BSD-3-Clause
#include "holba/pipeline/output.h"

#include <algorithm>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "holba/base/temporary_paths.h"
#include "holba/base/threads.h"
#include "holba/frontend/photographs/photograph.h"
#include "holba/frontend/drawing/pictures.h"
#include "holba/io/files.h"
#include "holba/io/ply.h"

namespace holba {
namespace fs = std::filesystem;
namespace {

constexpr int kTopViewPx = 1200;

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

void WriteStructurePly(const Reconstruction& model, const fs::path& folder) {
  WritePly(model, folder / "structure.ply", {.points = false, .lines = true, .groups = true});
  WritePly(model, folder / "points.ply", {.points = true, .lines = false, .groups = false});
}

void WritePictures(const Reconstruction& model, const PhotographFolder& image_path,
                   const fs::path& folder, int num_pictures, int num_threads) {
  const size_t num_images = model.images.size();
  const size_t count =
      num_pictures < 0 ? num_images : std::min(num_images, static_cast<size_t>(num_pictures));
  // Filled beside it and renamed, so that an interrupted run leaves the old pictures or the new.
  const TemporaryPath stage(folder / ".pictures.new");
  fs::remove_all(stage.path());
  fs::create_directories(stage.path());
  const std::vector<std::string> stems = FlatStems(model);
  ParallelTasks(num_threads, count + 1, [&](size_t i) {
    if (i == count) {
      WriteImage(DrawTopView(model, kTopViewPx), stage.path() / "top_view.png");
      return;
    }
    const size_t image_idx = i * num_images / count;
    const auto& [image_id, image] = *(model.images.begin() + image_idx);
    const ColourImage photograph = ReadColourImage(image_path / image.name);
    const std::string& stem = stems[image_idx];
    WriteImage(DrawSegments(model, image_id, photograph), stage.path() / (stem + "_lines.jpg"));
    WriteImage(DrawGroups(model, image_id, photograph), stage.path() / (stem + "_groups.jpg"));
    WriteImage(DrawWireframe(model, image_id, photograph),
               stage.path() / (stem + "_wireframe.jpg"));
  });
  const HoldSignals hold;
  fs::remove_all(folder / "pictures");
  fs::rename(stage.path(), folder / "pictures");
}

}  // namespace holba
