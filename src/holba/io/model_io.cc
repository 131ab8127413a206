// SPDX-License-Identifier: BSD-3-Clause
#include "holba/io/model_io.h"

#include <algorithm>
#include <array>
#include <map>
#include <string>

#include "holba/base/check.h"
#include "holba/base/file_faults.h"
#include "holba/base/log.h"
#include "holba/base/words.h"
#include "holba/io/bal.h"
#include "holba/io/colmap_files.h"
#include "holba/io/files.h"
#include "holba/io/foreign/foreign_model.h"
#include "holba/io/foreign/limap.h"
#include "holba/io/foreign/limap_database.h"
#include "holba/io/holistic_json.h"
#include "holba/io/record_faults.h"
#include "holba/io/side_files.h"
#include "holba/scene/one_sided_links.h"

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
  return std::any_of(model.points3D.begin(), model.points3D.end(), [](const auto& entry) {
    return entry.second.origin != PointOrigin::kDetected;
  });
}
bool HasUnregisteredFrames(const Reconstruction& model) {
  return model.has_rig_files && !model.unregistered_frames.empty();
}
bool HasUnregisteredImages(const Reconstruction& model) {
  return !model.unregistered_images.empty();
}

constexpr FileKind kCameras{"cameras", ReadCameras, WriteCameras};
constexpr FileKind kRigs{"rigs", ReadRigs, WriteRigs};
constexpr FileKind kFrames{"frames", ReadFrames, WriteFrames};
constexpr FileKind kImages{"images", ReadImages, WriteImages};
constexpr FileKind kPoints3D{"points3D", ReadPoints3D, WritePoints3D};
// In the order in which they are read.
constexpr std::array<FileKind, 9> kSideFiles{
    {{"unregistered_frames", ReadUnregisteredFrames, WriteUnregisteredFrames,
      HasUnregisteredFrames},
     {"unregistered_images", ReadUnregisteredImages, WriteUnregisteredImages,
      HasUnregisteredImages},
     {"point_origins", ReadPointOrigins, WritePointOrigins, HasNamedOrigins},
     {"lines2D", ReadLines2D, WriteLines2D},
     {"lines3D", ReadLines3D, WriteLines3D},
     {"groups2D", ReadGroups2D, WriteGroups2D},
     {"groups3D", ReadGroups3D, WriteGroups3D},
     {"wireframe", ReadWireframe, WriteWireframe},
     {"relations", ReadRelations, WriteRelations}}};

std::string FileName(const FileKind& kind, ModelFormat format) {
  return std::string(kind.name) + Extension(format);
}

// COLMAP's reader of text takes an image's name to its first blank; its writer and ours do not.
void WarnOfBlanks(const Reconstruction& model) {
  size_t count = 0;
  const std::string* example = nullptr;
  for (const auto& [image_id, image] : model.images) {
    if (image.name.find_first_of(" \t") == std::string::npos) continue;
    if (count++ == 0) example = &image.name;
  }
  if (count == 0) return;
  LogWarning(
      "{} {} a name with blanks ('{}'), at which COLMAP's reader of text cuts it; for COLMAP write "
      "the model as binary (--output_type bin), or rename the images",
      Counted(count, "image"), Agree(count, "has", "have"), *example);
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
         std::any_of(model.unregistered_images.begin(), model.unregistered_images.end(),
                     has_structure);
}

}  // namespace

bool IsModelFile(std::string_view name) {
  if (name == kHolisticJson || IsLimapFile(name)) return true;
  const auto is = [&](const FileKind& kind) {
    return name == FileName(kind, ModelFormat::kText) ||
           name == FileName(kind, ModelFormat::kBinary);
  };
  return is(kCameras) || is(kRigs) || is(kFrames) || is(kImages) || is(kPoints3D) ||
         std::any_of(kSideFiles.begin(), kSideFiles.end(), is);
}

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

bool HoldsPoses(const fs::path& folder) {
  return fs::exists(folder / FileName(kImages, ModelFormat::kBinary)) ||
         fs::exists(folder / FileName(kImages, ModelFormat::kText)) ||
         FindForeignFile(folder).has_value();
}

void ReadModelOptions::Describe(OptionTable* table) const {
  table
      ->Field(
          "strict", &strict,
          "Refuse an input that is damaged in places, with the list of them, instead of leaving "
          "these out with a warning: links between points and images that one of the two does "
          "not know; for refine also photographs that are missing, unreadable or of another size.")
      .Advanced();
}

namespace {

void CheckFolder(const fs::path& folder) {
  if (!fs::exists(folder)) throw NoSuchFolder(folder);
  if (!fs::is_directory(folder)) throw FolderIsWanted(folder);
}

// Names are how photographs, databases and other models are found.
void CheckNames(const Reconstruction& model, const fs::path& folder) {
  std::map<std::string_view, image_t> id_of_name;
  for (const auto* images : {&model.images, &model.unregistered_images}) {
    for (const auto& [image_id, image] : *images) {
      const auto [first, is_new] = id_of_name.emplace(image.name, image_id);
      if (is_new) continue;
      throw InputError(folder, fmt::format("images {} and {} have the same name '{}'; give one of "
                                           "them another, or remove it from the model",
                                           first->second, image_id, image.name));
    }
  }
}

void MendLinks(const ReadModelOptions& options, const fs::path& folder, Reconstruction* model) {
  const OneSidedLinks found = DropOneSidedLinks(options.strict, model);
  if (found.empty()) return;
  const size_t num_dropped = found.NumDropped();
  std::string faults;
  for (const auto& [reason, count] : found.dropped)
    faults += fmt::format("{}{}: {}", faults.empty() ? "" : ", ", reason, count);
  if (found.num_corrected > 0) {
    faults += fmt::format("{}3D features that name a 2D feature by a wrong index: {}",
                          faults.empty() ? "" : ", ", found.num_corrected);
  }
  const size_t num_all = num_dropped + found.num_corrected + found.num_sound;
  if (options.strict) {
    std::string message = fmt::format(
        "links between features of images and 3D features that only one of the two knows: {} of {} "
        "({}); --strict 0 leaves them out and uses the rest; they are:",
        num_dropped + found.num_corrected, num_all, faults);
    for (const std::string& text : found.list) message += "\n  " + text;
    throw InputError(folder, message);
  }
  LogWarning(
      "{}: left out {}{} of {} between features of images and 3D features, as only one of the two "
      "knows them ({}); the rest is used, --strict 1 lists them and stops",
      folder.string(), num_dropped,
      found.num_corrected > 0 ? fmt::format(" and corrected {}", found.num_corrected) : "",
      Counted(num_all, "link"), faults);
}

// Of a folder without a whole model: which of its files are there, and which are not.
std::string WhatIsMissing(const fs::path& folder) {
  const std::string expected =
      "expected a COLMAP model in this folder (cameras, images and points3D, all three as .bin or "
      "all three as .txt)";
  std::string best;
  size_t num_best = 0;
  for (const ModelFormat format : {ModelFormat::kBinary, ModelFormat::kText}) {
    std::string there, missing;
    size_t num_there = 0;
    for (const FileKind& kind : {kCameras, kImages, kPoints3D}) {
      const bool is_there = fs::exists(folder / FileName(kind, format));
      std::string& list = is_there ? there : missing;
      list += (list.empty() ? "" : " and ") + FileName(kind, format);
      num_there += is_there;
    }
    if (num_there <= num_best) continue;
    num_best = num_there;
    best = fmt::format("{}, found {} without {}; ", expected, there, missing);
    best += missing == FileName(kPoints3D, format)
                ? fmt::format(
                      "triangulate points (colmap point_triangulator), or give an empty {} "
                      "if the poses alone are wanted",
                      missing)
                : "add what is missing, or export the model anew";
  }
  return num_best > 0 ? best : expected + ", found none of these; give the folder that holds them";
}

void ReadSideFiles(const fs::path& folder, Reconstruction* model) {
  // First of our files: if the cameras have moved, that is to be said, not what follows from it.
  const fs::path json = folder / kHolisticJson;
  if (fs::exists(json))
    CheckFrame(ParseHolisticJson(ReadFileBytes(json), json), FrameOf(*model), json);
  for (const FileKind& kind : kSideFiles) {
    for (const ModelFormat side_format : {ModelFormat::kBinary, ModelFormat::kText}) {
      if (!fs::exists(folder / FileName(kind, side_format))) continue;
      ReadFile(folder, kind, side_format, model);
      break;
    }
  }
}

void ReadRigsAndFrames(const fs::path& folder, ModelFormat format, Reconstruction* model) {
  const bool has_rigs = fs::exists(folder / FileName(kRigs, format));
  const bool has_frames = fs::exists(folder / FileName(kFrames, format));
  if (has_rigs != has_frames) {
    throw InputError(folder, fmt::format("expected {} and {} both or neither, found {} only; add "
                                         "the other one, or remove this one",
                                         FileName(kRigs, format), FileName(kFrames, format),
                                         FileName(has_rigs ? kRigs : kFrames, format)));
  }
  if (!has_rigs) return;
  ReadFile(folder, kRigs, format, model);
  ReadFile(folder, kFrames, format, model);
}

void CheckConsistency(const Reconstruction& model, const fs::path& folder) {
  if (const std::optional<std::string> fault = model.FindInconsistency()) {
    throw InputError(
        folder,
        fmt::format("the files of this model do not fit each other ({}); {}", *fault,
                    IsHolistic(model) ? std::string("perhaps ") + kSideFilesRemedy : kMendModel));
  }
}

}  // namespace

namespace {

Reconstruction ReadFolder(const fs::path& folder, ModelFormat format) {
  Reconstruction model;
  ReadFile(folder, kCameras, format, &model);
  ReadRigsAndFrames(folder, format, &model);
  ReadFile(folder, kImages, format, &model);
  ReadFile(folder, kPoints3D, format, &model);
  ReadSideFiles(folder, &model);
  // What both programs wrote into one folder: ours say more.
  if (!IsHolistic(model) && HoldsLimapStructures(folder)) ReadLimapStructures(folder, &model);
  return model;
}

// Of what is no folder of COLMAP's: another program's file. Null: it is none.
std::optional<fs::path> OtherProgramsFile(const fs::path& path) {
  if (!fs::is_directory(path)) return path;
  if (FindModelFormat(path)) return std::nullopt;
  return FindForeignFile(path);
}

}  // namespace

bool IsReadAsBal(const fs::path& path) {
  return fs::is_regular_file(path) && FindForeignFormat(path) == nullptr && !IsLimapDatabase(path);
}

Reconstruction ReadModel(const fs::path& path, const ReadModelOptions& options) {
  if (!fs::exists(path)) throw NoSuchFileOrFolder(path);
  Reconstruction model;
  if (const std::optional<fs::path> file = OtherProgramsFile(path)) {
    const ForeignFormat* const format = FindForeignFormat(*file);
    if (format != nullptr) {
      model = ReadForeignModel(*format, *file);
    } else if (IsLimapDatabase(*file)) {
      model = ReadLimapDatabaseAsModel(*file);
    } else {
      return ReadBal(*file);
    }
  } else {
    CheckFolder(path);
    const std::optional<ModelFormat> format = FindModelFormat(path);
    if (!format) throw InputError(path, WhatIsMissing(path));
    model = ReadFolder(path, *format);
  }
  CheckNames(model, path);
  MendLinks(options, path, &model);
  CheckConsistency(model, path);
  return model;
}

Reconstruction ReadPoses(const fs::path& folder) {
  if (!fs::exists(folder)) throw NoSuchFileOrFolder(folder);
  if (!fs::is_directory(folder) || FindModelFormat(folder) || FindForeignFile(folder))
    return ReadModel(folder);
  if (!HoldsPoses(folder)) {
    throw InputError(
        folder, "expected the poses of a COLMAP model in this folder: images.bin or images.txt");
  }
  const ModelFormat format = fs::exists(folder / FileName(kImages, ModelFormat::kBinary))
                                 ? ModelFormat::kBinary
                                 : ModelFormat::kText;
  Reconstruction model;
  if (fs::exists(folder / FileName(kCameras, format))) {
    ReadFile(folder, kCameras, format, &model);
    ReadRigsAndFrames(folder, format, &model);
    ReadFile(folder, kImages, format, &model);
  } else {
    // The file of images has every pose, also with rigs and frames, which need the cameras.
    const fs::path path = folder / FileName(kImages, format);
    ReadImagePoses(format, ReadFileBytes(path), path, &model);
  }
  CheckNames(model, folder);
  DropOneSidedLinks(false, &model);  // there are no points to name
  CheckConsistency(model, folder);
  return model;
}

void StageModel(const Reconstruction& model, ModelFormat format, const std::string& prefix,
                StagedFolder* stage) {
  const std::optional<std::string> fault = model.FindInconsistency();
  HOLBA_CHECK_MSG(!fault, "a model that is to be written is inconsistent: " + *fault);
  const auto write = [&](const FileKind& kind) {
    stage->Write(prefix + FileName(kind, format),
                 [&](std::ostream* stream) { kind.write(format, model, stream); });
  };
  write(kCameras);
  if (model.has_rig_files) {
    write(kRigs);
    write(kFrames);
  }
  write(kImages);
  if (format == ModelFormat::kText) WarnOfBlanks(model);
  write(kPoints3D);
  const bool is_holistic = IsHolistic(model);
  for (const FileKind& kind : kSideFiles) {
    if (kind.is_needed != nullptr ? kind.is_needed(model) : is_holistic) write(kind);
  }
  if (is_holistic) {
    stage->Write(prefix + kHolisticJson,
                 [&](std::ostream* stream) { *stream << HolisticJson(FrameOf(model)); });
  }
}

void WriteModel(const Reconstruction& model, const fs::path& folder, ModelFormat format) {
  StagedFolder stage(folder);
  StageModel(model, format, "", &stage);
  stage.Commit(IsModelFile);
}

void ProbeModelFolder(const fs::path& folder) { ProbeFolder(folder, IsModelFile); }

}  // namespace holba
