// SPDX-License-Identifier: BSD-3-Clause
#include "holba/io/model_io.h"

#include <algorithm>
#include <array>

#include "holba/base/check.h"
#include "holba/io/colmap_files.h"
#include "holba/io/files.h"
#include "holba/io/holistic_json.h"
#include "holba/io/side_files.h"

namespace holba {
namespace fs = std::filesystem;
namespace {

constexpr const char* kHolisticJson = "holistic.json";

using Reader = void (*)(ModelFormat, std::string_view, const fs::path&, Reconstruction*);
using Writer = void (*)(ModelFormat, const Reconstruction&, std::ostream*);

struct FileKind {
  const char* name;
  Reader read;
  Writer write;
  // Whether a model has what the file holds. Null: the file is written with the others of its kind.
  bool (*is_needed)(const Reconstruction&) = nullptr;
};

bool HasNamedOrigins(const Reconstruction& model) {
  return std::any_of(model.points3D.begin(), model.points3D.end(),
                     [](const auto& entry) { return entry.second.origin != PointOrigin::kDetected; });
}
bool HasUnregisteredFrames(const Reconstruction& model) {
  return model.has_rig_files && !model.unregistered_frames.empty();
}
bool HasUnregisteredImages(const Reconstruction& model) { return !model.unregistered_images.empty(); }

constexpr FileKind kCameras{"cameras", ReadCameras, WriteCameras};
constexpr FileKind kRigs{"rigs", ReadRigs, WriteRigs};
constexpr FileKind kFrames{"frames", ReadFrames, WriteFrames};
constexpr FileKind kImages{"images", ReadImages, WriteImages};
constexpr FileKind kPoints3D{"points3D", ReadPoints3D, WritePoints3D};
// In the order in which they are read.
constexpr std::array<FileKind, 9> kSideFiles{{{"unregistered_frames", ReadUnregisteredFrames,
                                               WriteUnregisteredFrames, HasUnregisteredFrames},
                                              {"unregistered_images", ReadUnregisteredImages,
                                               WriteUnregisteredImages, HasUnregisteredImages},
                                              {"point_origins", ReadPointOrigins, WritePointOrigins,
                                               HasNamedOrigins},
                                              {"lines2D", ReadLines2D, WriteLines2D},
                                              {"lines3D", ReadLines3D, WriteLines3D},
                                              {"groups2D", ReadGroups2D, WriteGroups2D},
                                              {"groups3D", ReadGroups3D, WriteGroups3D},
                                              {"wireframe", ReadWireframe, WriteWireframe},
                                              {"relations", ReadRelations, WriteRelations}}};

std::string FileName(const FileKind& kind, ModelFormat format) {
  return std::string(kind.name) + Extension(format);
}

bool IsModelFile(std::string_view name) {
  if (name == kHolisticJson) return true;
  const auto is = [&](const FileKind& kind) {
    return name == FileName(kind, ModelFormat::kText) ||
           name == FileName(kind, ModelFormat::kBinary);
  };
  return is(kCameras) || is(kRigs) || is(kFrames) || is(kImages) || is(kPoints3D) ||
         std::any_of(kSideFiles.begin(), kSideFiles.end(), is);
}

void ReadFile(const fs::path& folder, const FileKind& kind, ModelFormat format,
              Reconstruction* model) {
  const fs::path path = folder / FileName(kind, format);
  kind.read(format, ReadFileBytes(path), path, model);
}

bool IsHolistic(const Reconstruction& model) {
  const auto has_structure = [](const auto& entry) {
    return !entry.second.lines2D.empty() || !entry.second.groups2D.empty();
  };
  return !model.lines3D.empty() || !model.groups3D.empty() || !model.wireframe.empty() ||
         !model.relations.empty() ||
         std::any_of(model.images.begin(), model.images.end(), has_structure) ||
         std::any_of(model.unregistered_images.begin(), model.unregistered_images.end(), has_structure);
}

}  // namespace

std::optional<ModelFormat> FindModelFormat(const fs::path& folder) {
  for (const ModelFormat format : {ModelFormat::kBinary, ModelFormat::kText}) {
    if (fs::exists(folder / FileName(kCameras, format)) &&
        fs::exists(folder / FileName(kImages, format)) &&
        fs::exists(folder / FileName(kPoints3D, format))) {
      return format;
    }
  }
  return std::nullopt;
}

Reconstruction ReadModel(const fs::path& folder) {
  if (!fs::exists(folder)) throw InputError(folder, "there is no such folder");
  if (!fs::is_directory(folder)) throw InputError(folder, "expected a model folder, found a file");
  const std::optional<ModelFormat> format = FindModelFormat(folder);
  if (!format) {
    throw InputError(
        folder,
        "expected a COLMAP model in this folder: cameras, images and points3D, all three as "
        ".bin or all three as .txt");
  }
  Reconstruction model;
  ReadFile(folder, kCameras, *format, &model);
  const bool has_rigs = fs::exists(folder / FileName(kRigs, *format));
  const bool has_frames = fs::exists(folder / FileName(kFrames, *format));
  if (has_rigs != has_frames) {
    throw InputError(folder, fmt::format("expected {} and {} both or neither, found {} only",
                                         FileName(kRigs, *format), FileName(kFrames, *format),
                                         FileName(has_rigs ? kRigs : kFrames, *format)));
  }
  if (has_rigs) {
    ReadFile(folder, kRigs, *format, &model);
    ReadFile(folder, kFrames, *format, &model);
  }
  ReadFile(folder, kImages, *format, &model);
  ReadFile(folder, kPoints3D, *format, &model);

  // First of our files: if the cameras have moved, that is to be said, not what follows from it.
  const fs::path json = folder / kHolisticJson;
  if (fs::exists(json))
    CheckFrame(ParseHolisticJson(ReadFileBytes(json), json), FrameOf(model), json);
  for (const FileKind& kind : kSideFiles) {
    for (const ModelFormat side_format : {ModelFormat::kBinary, ModelFormat::kText}) {
      if (!fs::exists(folder / FileName(kind, side_format))) continue;
      ReadFile(folder, kind, side_format, &model);
      break;
    }
  }
  if (const std::optional<std::string> fault = model.FindInconsistency()) {
    throw InputError(folder,
                     "the files of this model do not fit each other: " + *fault +
                         (IsHolistic(model) ? std::string("; perhaps ") + kSideFilesRemedy : ""));
  }
  return model;
}

void WriteModel(const Reconstruction& model, const fs::path& folder, ModelFormat format) {
  const std::optional<std::string> fault = model.FindInconsistency();
  HOLBA_CHECK_MSG(!fault, "a model that is to be written is inconsistent: " + *fault);
  StagedFolder stage(folder);
  const auto write = [&](const FileKind& kind) {
    stage.Write(FileName(kind, format),
                [&](std::ostream* stream) { kind.write(format, model, stream); });
  };
  write(kCameras);
  if (model.has_rig_files) {
    write(kRigs);
    write(kFrames);
  }
  write(kImages);
  write(kPoints3D);
  const bool is_holistic = IsHolistic(model);
  for (const FileKind& kind : kSideFiles) {
    if (kind.is_needed != nullptr ? kind.is_needed(model) : is_holistic) write(kind);
  }
  if (is_holistic) {
    stage.Write(kHolisticJson,
                [&](std::ostream* stream) { *stream << HolisticJson(FrameOf(model)); });
  }
  stage.Commit(IsModelFile);
}

}  // namespace holba
