// SPDX-License-Identifier: BSD-3-Clause
// holba extract: photographs to a COLMAP database of their features.
#include "holba/pipeline/extract.h"

#include <string>

#include "apps/command.h"
#include "apps/extract/extract_stage.h"
#include "apps/extract/report.h"
#include "holba/io/database.h"

namespace holba {
namespace {

class ExtractJob : public Job {
 public:
  void Describe(OptionTable* table) const override {
    table->Field("image_path", &image_path_, "Folder of the photographs.").Required();
    table
        ->Field("database_path", &database_path_,
                "COLMAP database; made if it is not there, else what it has is kept.")
        .Required();
    options_.Describe(table);
  }

  void ProbeOutputs(const Invocation&) const override {
    ProbeDatabase(database_path_);
    ProbeResult();
  }

  void Run(const Invocation& invocation) override {
    const ExtractReport report = RunExtract(options_, image_path_, database_path_);
    PrintResult(invocation.json ? JsonText(ExtractToJson(report)) : ExtractToText(report));
  }

 private:
  std::string image_path_, database_path_;
  ExtractOptions options_;
};

}  // namespace

Command ExtractCommand() {
  return {.name = "extract",
          .summary = "Find points, lines and vanishing points in photographs, into a database",
          .details =
              "Makes a COLMAP database of a folder of photographs: cameras (from EXIF, or given), "
              "SIFT features as COLMAP's\n"
              "feature_extractor finds them, and beside them segments, corners and vanishing "
              "points. COLMAP, hloc and holba go\n"
              "on from it. A run that was interrupted goes on where it was.",
          .supports_json = true,
          .make_job = [] { return std::make_unique<ExtractJob>(); }};
}

}  // namespace holba
