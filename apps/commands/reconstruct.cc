// SPDX-License-Identifier: BSD-3-Clause
// holba reconstruct: photographs to posed models of points and structure.
#include <fmt/format.h>

#include <filesystem>
#include <string>

#include "apps/command.h"
#include "apps/extract/extract_stage.h"
#include "apps/extract/report.h"
#include "apps/map/map_stages.h"
#include "apps/match/match_stage.h"
#include "holba/base/error.h"
#include "holba/base/file_faults.h"
#include "holba/base/log.h"
#include "holba/io/database.h"

namespace holba {
namespace {

class ReconstructJob : public Job {
 public:
  ReconstructJob() { match_.pairs.selection = PairSelection::kAutomatic; }

  void Describe(OptionTable* table) const override {
    table->Field("image_path", &image_path_, "Folder of the photographs.").Required();
    table
        ->Field("output_path", &output_path_,
                "Folder of the models 0, 1, ..., the one with the most images first.")
        .Required();
    table->Field("database_path", &database_path_,
                 "COLMAP database of features and matches, from which the next run starts; empty: "
                 "database.db in the output folder.");
    extract_.DescribePoints(table);
    match_.pairs.Describe(table);
    match_.matching.DescribeMatching(table);
    stages_.DescribeWithoutPhotographs(table);
  }

  void ProbeOutputs(const Invocation&) const override {
    ProbeModels(output_path_);
    ProbeDatabase(DatabasePath());
    ProbeResult();
  }

  void Run(const Invocation& invocation) override {
    if (!std::filesystem::is_directory(image_path_))
      throw NoSuchFolder(image_path_, "--image_path");
    ShareOptions();
    const std::string database_path = DatabasePath().string();
    const ExtractReport extracted = RunExtract(extract_, image_path_, database_path);
    const MatchOutput matched = RunMatch(match_, database_path);
    const auto reports = [&](const MapOutput& mapped) {
      MapReports all = ReportsOf(mapped);
      all.json = {{"extract", ExtractToJson(extracted)},
                  {"match", MatchToJson(matched)},
                  {"map", std::move(all.json)}};
      all.text = fmt::format("Photographs\n\n{}\nMatches\n\n{}\nModels\n\n{}",
                             ExtractToText(extracted), MatchToText(matched), all.text);
      return all;
    };
    const MapOutput mapped = stages_.Run(
        {.database_path = database_path, .image_path = image_path_, .output_path = output_path_},
        reports);
    PrintResult(invocation.json ? JsonText(reports(mapped).json) : MapToText(mapped));
  }

 private:
  std::filesystem::path DatabasePath() const {
    return database_path_.empty() ? std::filesystem::path(output_path_) / "database.db"
                                  : std::filesystem::path(database_path_);
  }

  // Each option has one place; what several stages need of it is handed on here.
  void ShareOptions() {
    stages_.SetPhotographs(extract_.reader.mask_path, extract_.reader.camera_mask_path,
                           extract_.strict);
    stages_.Check();
    if (match_.matching.skip_geometric_verification) {
      throw InputError(
          "--FeatureMatching.skip_geometric_verification must be 0, as models are made of verified "
          "matches");
    }
    const DetectionOptions& detection = stages_.detection();
    extract_.structure = stages_.structure() != MapperStructure::kNone;
    if (extract_.structure) extract_.imports = detection.imports;
    // What says something about pairs of images is for the models.
    extract_.imports.line_matches = extract_.imports.correspondences = "";
    extract_.segment_import = detection.segment_import;
    extract_.region_normals = detection.region_normals;
    extract_.extraction = detection.extraction;
    extract_.vps = detection.vps;
    match_.segments = stages_.SegmentMatching();
    extract_.num_threads = match_.matching.num_threads = stages_.num_threads();
  }

  std::string image_path_, output_path_, database_path_;
  ExtractOptions extract_;
  MatchStageOptions match_;
  MapStages stages_;
};

}  // namespace

Command ReconstructCommand() {
  return {.name = "reconstruct",
          .summary = "Make posed models of points, lines and groups of a folder of photographs",
          .details =
              "From photographs alone: 'holba extract', 'holba match' and 'holba map' with their "
              "defaults. What is found is kept in\n"
              "a database, so that a further run goes on from there.",
          .supports_json = true,
          .advanced_sections = {"Refine", "Bundle"},
          .make_job = [] { return std::make_unique<ReconstructJob>(); }};
}

}  // namespace holba
