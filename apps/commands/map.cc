// SPDX-License-Identifier: BSD-3-Clause
// holba map: the images of a database to posed models of points and structure.
#include <filesystem>
#include <string>

#include "apps/command.h"
#include "apps/map/map_stages.h"
#include "apps/map/report.h"
#include "holba/base/file_faults.h"
#include "holba/io/database.h"
namespace holba {
namespace {

class MapJob : public Job {
 public:
  void Describe(OptionTable* table) const override {
    table
        ->Field(
            "database_path", &database_path_,
            "COLMAP database with keypoints and verified matches (of holba match, COLMAP, hloc).")
        .Required();
    table
        ->Field("output_path", &output_path_,
                "Folder of the models 0, 1, ..., the one with the most images first.")
        .Required();
    table->Field("image_path", &image_path_,
                 "Folder of the photographs, for structure that the database lacks, colours and "
                 "pictures; empty: what the database has.");
    table->Field(
        "input_path", &input_path_,
        "Model that is continued with further images of this database, ours or COLMAP's; empty: "
        "none.");
    stages_.Describe(table);
  }

  void ProbeOutputs(const Invocation&) const override {
    ProbeModels(output_path_);
    ProbeExistingDatabase(database_path_);
    ProbeResult();
  }

  void Run(const Invocation& invocation) override {
    if (!image_path_.empty() && !std::filesystem::is_directory(image_path_))
      throw NoSuchFolder(image_path_, "--image_path");
    const MapOutput output = stages_.Run({.database_path = database_path_,
                                          .image_path = image_path_,
                                          .input_path = input_path_,
                                          .output_path = output_path_});
    PrintResult(invocation.json ? JsonText(MapToJson(output)) : MapToText(output));
  }

 private:
  std::string database_path_, image_path_, input_path_, output_path_;
  MapStages stages_;
};

}  // namespace

Command MapCommand() {
  return {
      .name = "map",
      .summary = "Make posed models of points, lines and groups of a database's images",
      .details =
          "Takes the place of colmap mapper: from keypoints and verified matches to camera "
          "poses and points, and with what is\n"
          "found of lines and vanishing points to structure that takes part in registration and "
          "adjustment. Options have the names\n"
          "that COLMAP gives them where they mean the same.",
      .supports_json = true,
      .advanced_sections = {"Refine", "Bundle"},
      .make_job = [] { return std::make_unique<MapJob>(); }};
}

}  // namespace holba
