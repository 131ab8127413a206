// SPDX-License-Identifier: BSD-3-Clause
// holba localize: poses of new photographs in a finished model.
#include "holba/pipeline/localize.h"

#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "apps/command.h"
#include "apps/localize/report.h"
#include "holba/base/error.h"
#include "holba/base/file_faults.h"
#include "holba/base/progress.h"
#include "holba/frontend/photographs/opencv_threads.h"
#include "holba/io/database.h"
#include "holba/io/files.h"
#include "holba/io/model_io.h"

namespace holba {
namespace fs = std::filesystem;
namespace {

constexpr const char* kPosesFile = "localization.json";

// SQLite's own copy, with what its journal holds.
void CopyDatabase(const fs::path& from, const fs::path& to) {
  std::string quoted;
  for (char c : to.string()) quoted += c == '\'' ? std::string("''") : std::string(1, c);
  Database(from).Execute("VACUUM INTO '" + quoted + "'");
}

class LocalizeJob : public Job {
 public:
  void Describe(OptionTable* table) const override {
    table
        ->Field("database_path", &database_path_,
                "COLMAP database with the features of the model's images; it stays as it is. "
                "Empty: they are found anew in their photographs.")
        .Basic();
    table
        ->Field("image_path", &image_path_,
                "Folder of the photographs, new ones and, where the database lacks them, the "
                "model's; empty: the database has the features of all.")
        .Basic();
    table->Field("input_path", &input_path_, "Folder of the model, ours or COLMAP's.").Required();
    table
        ->Field("output_path", &output_path_,
                "Folder for localization.json, and for the model with the new images.")
        .Required();
    table->Field("write_model", &write_model_,
                 "Whether the model is written, with the new images and what they observe.");
    table->Choice("output_type", &format_,
                  {{"txt", ModelFormat::kText}, {"bin", ModelFormat::kBinary}},
                  "Format of the model folder.");
    options_.Describe(table);
  }

  void ProbeOutputs(const Invocation&) const override {
    if (!database_path_.empty()) ProbeExistingDatabase(database_path_);
    ProbeModelFolder(output_path_);
    ProbeResult();
  }

  void Run(const Invocation& invocation) override {
    if (!image_path_.empty() && !fs::is_directory(image_path_))
      throw NoSuchFolder(image_path_, "--image_path");
    options_.Check();
    HoldOpenCvThreads();
    Reconstruction model = ReadModel(input_path_);
    if (database_path_.empty() && image_path_.empty()) {
      throw InputError("there is nothing to localise; give --image_path, --database_path or both");
    }
    StagedFolder stage(output_path_);
    const fs::path copy = stage.path() / "features.db";
    if (!database_path_.empty()) CopyDatabase(database_path_, copy);
    LocalizeReport report;
    {
      Database database(copy);
      std::optional<Progress> progress;
      std::string current;
      report =
          Localize(options_, image_path_, stage.path(), &database, &model,
                   [&](const std::string& step, size_t num_done, size_t num_all) {
                     if (step != current || !progress) {
                       progress.emplace(step, step == "Matching" ? "pairs" : "images", num_all);
                       current = step;
                     }
                     progress->Update(num_done);
                     if (num_done == num_all) progress.reset();
                   });
    }
    for (const char* ending : {"", "-wal", "-shm", "-journal"}) fs::remove(copy.string() + ending);
    const nlohmann::json json = LocalizeToJson(report);
    stage.Write(kPosesFile, [&](std::ostream* out) { *out << JsonText(json); });
    if (write_model_) StageModel(model, format_, "", &stage);
    stage.Commit([this](std::string_view name) {
      return name == kPosesFile || (write_model_ && IsModelFile(name));
    });
    PrintResult(invocation.json ? JsonText(json) : LocalizeToText(report));
  }

 private:
  std::string database_path_, image_path_, input_path_, output_path_;
  bool write_model_ = true;
  ModelFormat format_ = ModelFormat::kBinary;
  LocalizeOptions options_;
};

}  // namespace

Command LocalizeCommand() {
  return {
      .name = "localize",
      .summary = "Find the poses of new photographs in a finished model",
      .details =
          "Matches photographs with the images of a model, ours or COLMAP's, and finds their "
          "poses from the points, lines and\n"
          "vanishing directions that they see of it, with covariances. A photograph's focal length "
          "may be unknown. The model stays\n"
          "as it is; a copy with the new images goes to --output_path.",
      .supports_json = true,
      .make_job = [] { return std::make_unique<LocalizeJob>(); }};
}

}  // namespace holba
