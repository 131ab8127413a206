// SPDX-License-Identifier: BSD-3-Clause
#include "apps/render/place_set.h"

#include "holba/base/error.h"
#include "holba/io/model_io.h"

#if defined(HOLBA_WITH_EMBREE)
#include "holba/base/file_faults.h"
#include "holba/base/log.h"
#include "holba/base/progress.h"
#include "holba/base/words.h"
#include "holba/frontend/photographs/photograph.h"
#include "holba/frontend/photographs/png_file.h"
#include "holba/render/place_files.h"
#include "holba/render/presets.h"
#endif

namespace holba {

bool IsPlaceSetFile(std::string_view name) {
  const std::string_view first = name.substr(0, name.find('/'));
  if (name == first) {
    return name == "images" || name == "depth" || name == "normals" || name == "labels" ||
           name == "mesh.ply";
  }
  return first == "truth" && IsModelFile(name.substr(first.size() + 1));
}

#if defined(HOLBA_WITH_EMBREE)

void PlaceSetOptions::Describe(OptionTable* table) const {
  table->Choice("image_format", &is_jpeg, {{"jpg", true}, {"png", false}},
                "Format of the photographs of a preset.");
  table->Field("maps", &maps, "Depth, normals and labels beside the photographs of a preset.");
  render.Describe(table);
}

namespace {

// Folders of maps have the folders of rigs, too.
std::filesystem::path PathIn(const StagedFolder& stage, std::string_view folder,
                             const std::string& name) {
  const std::filesystem::path path = stage.path() / folder / name;
  std::filesystem::create_directories(path.parent_path());
  return path;
}

std::string WithoutExtension(const std::string& name) { return name.substr(0, name.rfind('.')); }

void WriteMaps(const TruthMaps& maps, const std::string& stem, StagedFolder* stage) {
  stage->Write("depth/" + stem + ".npy",
               [&](std::ostream* stream) { FormatDepthNpy(maps, stream); });
  stage->Write("normals/" + stem + ".npy",
               [&](std::ostream* stream) { FormatNormalsNpy(maps, stream); });
  const std::filesystem::path labels = PathIn(*stage, "labels", stem + ".png");
  if (!WriteNumberPng(maps.width, maps.height, LabelsOf(maps), labels))
    throw CannotBeWritten(labels, SystemFault());
}

}  // namespace

void RenderPlaceSet(const std::string& preset, uint64_t seed, const PlaceSetOptions& options,
                    int num_threads, StagedFolder* stage) {
  RenderOptions render = options.render;
  render.seed = seed;
  std::optional<Progress> progress;
  progress.emplace("Computing the light", "steps", 1);
  Rendering rendering(BuildPreset(preset, seed), preset, options.is_jpeg ? "jpg" : "png", render,
                      num_threads, [&, is_first = true](size_t num_done, size_t total) mutable {
                        if (is_first) progress.emplace("Computing the light", "steps", total);
                        is_first = false;
                        progress->Update(num_done);
                      });
  rendering.AddTruthToModel();
  const Reconstruction& model = rendering.model();
  progress.emplace("Taking photographs", "photographs", model.images.size());
  size_t num_done = 0;
  for (const auto& [image_id, image] : model.images) {
    Photo photo = rendering.TakePhoto(image_id);
    WriteImage({photo.width, photo.height, std::move(photo.rgb)},
               PathIn(*stage, "images", image.name));
    if (options.maps) WriteMaps(rendering.MakeMaps(image_id), WithoutExtension(image.name), stage);
    progress->Update(++num_done);
  }
  progress.reset();
  if (options.maps) {
    stage->Write("labels/labels.json",
                 [&](std::ostream* stream) { *stream << LabelTypesJson(rendering.place()); });
    stage->Write("depth/depth.json",
                 [](std::ostream* stream) { *stream << "{\"scale\": 1.0, \"along\": \"z\"}\n"; });
  }
  stage->Write("mesh.ply",
               [&](std::ostream* stream) { FormatPlaceMesh(rendering.place(), stream); });
  StageModel(model, ModelFormat::kText, "truth/", stage);
  LogInfo("Made {} of {}; the truth has {}, {} and {}", Counted(model.images.size(), "photograph"),
          preset, Counted(model.points3D.size(), "point"), Counted(model.lines3D.size(), "line"),
          Counted(model.groups3D.size(), "group"));
}

#else

void PlaceSetOptions::Describe(OptionTable*) const {}

void RenderPlaceSet(const std::string& preset, uint64_t, const PlaceSetOptions&, int, bool,
                    StagedFolder*) {
  throw InputError(
      "preset '" + preset +
      "' needs Embree, which this holba was built without; give no preset, or build it with "
      "HOLBA_WITH_EMBREE");
}

#endif

}  // namespace holba
