// SPDX-License-Identifier: BSD-3-Clause
// holba import: a public data set as it was downloaded, as a set of photographs with true cameras
// and surfaces.
#include <fmt/format.h>

#include <filesystem>
#include <set>
#include <string>
#include <string_view>

#include "apps/command.h"
#include "holba/base/error.h"
#include "holba/base/file_faults.h"
#include "holba/base/log.h"
#include "holba/base/progress.h"
#include "holba/base/words.h"
#include "holba/datasets/dataset.h"
#include "holba/io/files.h"
#include "holba/io/model_io.h"
#include "holba/io/ply_reader.h"

namespace holba {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kImages = "images", kTruth = "gt", kScans = "scans";
constexpr std::string_view kDescription = "dataset.json", kMesh = "mesh.ply", kCloud = "cloud.ply";

enum class ImageMode { kLink, kCopy };

// What an earlier import to the same place left, and this one replaces.
bool IsOfImport(std::string_view name) {
  const size_t slash = name.find('/');
  if (slash != std::string_view::npos)
    return name.substr(0, slash) == kTruth && IsModelFile(name.substr(slash + 1));
  return name == kImages || name == kScans || name == kDescription || name == kMesh ||
         name == kCloud;
}

void PutFile(const DatasetFile& file, const fs::path& folder, ImageMode mode) {
  const fs::path target = folder / file.name;
  std::error_code error;
  fs::create_directories(target.parent_path(), error);
  if (error) throw FolderCannotBeMade(target.parent_path(), error.message());
  if (mode == ImageMode::kLink) {
    fs::create_symlink(fs::canonical(file.source), target, error);
  } else {
    fs::copy_file(file.source, target, error);
  }
  if (error) throw CannotBeWritten(target, error.message());
}

nlohmann::ordered_json Description(const Dataset& dataset, std::string_view name) {
  const auto or_null = [](const std::string& text) -> nlohmann::ordered_json {
    if (text.empty()) return nullptr;
    return text;
  };
  return {{"dataset", name},
          {"scene", dataset.scene},
          {"part", or_null(dataset.part)},
          {"unit", dataset.unit},
          {"images", {{"folder", kImages}, {"count", dataset.images.size()}}},
          {"truth",
           {{"model", kTruth},
            {"with_pose", dataset.truth.images.size()},
            {"frames", dataset.truth.frames.size()},
            {"has_rigs", dataset.truth.has_rig_files},
            {"source", dataset.pose_source}}},
          {"mesh", or_null(dataset.mesh_name)},
          {"point_cloud", or_null(dataset.point_cloud_name)},
          {"notes", dataset.notes}};
}

// Every known name, for help and refusals: "ETH3D, Hypersim and ...".
std::string NamesOfFormats() {
  std::string names;
  for (const DatasetFormat& format : AllDatasetFormats()) {
    names += (names.empty() ? "" : ", ") + std::string(format.name);
  }
  return names;
}

class ImportJob : public Job {
 public:
  void Describe(OptionTable* table) const override {
    table->Field("dataset", &dataset_, "Which data set: " + NamesOfFormats() + ".").Required();
    table->Field("input_path", &input_path_, "Folder of one scene or sequence, as downloaded.")
        .Required();
    table
        ->Field("output_path", &output_path_,
                "Folder to write to: images, gt (true cameras), surfaces and dataset.json.")
        .Required();
    table->Choice("image_mode", &mode_, {{"link", ImageMode::kLink}, {"copy", ImageMode::kCopy}},
                  "Whether photographs and scans are linked to or copied.");
    table->Choice("output_type", &output_type_,
                  {{"txt", ModelFormat::kText}, {"bin", ModelFormat::kBinary}},
                  "Format of the model of true cameras.");
    options_.Describe(table);
  }

  void ProbeOutputs(const Invocation& invocation) const override {
    ProbeFolder(output_path_, [](std::string_view) { return false; });
    ProbeModelFolder(fs::path(output_path_) / kTruth);
    if (invocation.json) ProbeResult();
  }

  void Run(const Invocation& invocation) override {
    const std::optional<DatasetFormat> format = FindDatasetFormat(dataset_);
    if (!format) {
      throw InputError("--dataset: expected one of " + NamesOfFormats() + ", found '" + dataset_ +
                       "'");
    }
    if (!fs::is_directory(input_path_)) throw NoSuchFolder(input_path_, "--input_path");
    const Dataset dataset = format->read(input_path_, options_);
    CheckNames(dataset);
    StagedFolder stage(output_path_);
    Progress progress("Photographs", "images", dataset.images.size());
    for (size_t i = 0; i < dataset.images.size(); ++i) {
      PutFile(dataset.images[i], stage.path() / kImages, mode_);
      progress.Update(i + 1);
    }
    for (const DatasetFile& file : dataset.surfaces) PutFile(file, stage.path(), mode_);
    if (dataset.mesh) {
      stage.Write(dataset.mesh_name, [&](std::ostream* out) {
        WriteTrianglePly(dataset.mesh->vertices, dataset.mesh->triangles, out);
      });
    }
    StageModel(dataset.truth, output_type_, std::string(kTruth) + '/', &stage);
    const nlohmann::ordered_json description = Description(dataset, format->name);
    stage.Write(std::string(kDescription),
                [&](std::ostream* out) { *out << description.dump(2) << '\n'; });
    stage.Commit(IsOfImport);
    for (const std::string& note : dataset.notes) LogInfo("{}", note);
    LogInfo("Wrote {} of {}, {} of them with true poses, to {}",
            Counted(dataset.images.size(), "photograph"), dataset.scene,
            dataset.truth.images.size(), output_path_);
    if (invocation.json) PrintResult(JsonText(description));
  }

 private:
  // Two photographs of one name would be one file.
  static void CheckNames(const Dataset& dataset) {
    std::set<std::string> names;
    for (const DatasetFile& image : dataset.images) {
      if (!names.insert(image.name).second) {
        throw InputError(image.source, "is the second photograph of the name " + image.name +
                                           " in the set; remove or rename one of the two");
      }
    }
  }

  std::string dataset_, input_path_, output_path_;
  ImageMode mode_ = ImageMode::kLink;
  ModelFormat output_type_ = ModelFormat::kText;
  DatasetOptions options_;
};

std::string Details() {
  std::string text =
      "Writes images/, the model gt/ of true cameras (with rigs and frames where the set has "
      "them), "
      "meshes and laser scans, and dataset.json, which says what is what, its unit and how far the "
      "truth can be trusted. What is read of each data set (docs/datasets.md):\n\n";
  for (const DatasetFormat& format : AllDatasetFormats()) {
    text += fmt::format("  {:<10} {}\n", format.name, format.summary);
  }
  text.pop_back();
  return text;
}

}  // namespace

Command ImportCommand() {
  return {.name = "import",
          .summary = "Read a public data set as it was downloaded",
          .details = Details(),
          .supports_json = true,
          .make_job = [] { return std::make_unique<ImportJob>(); }};
}

}  // namespace holba
