// SPDX-License-Identifier: BSD-3-Clause
// holba synthesize: a synthetic adjustment problem, as a true and a perturbed model, or the
// database of a synthetic set of photographs.
#include <filesystem>
#include <string>
#include <string_view>

#include "apps/command.h"
#include "apps/report.h"
#include "apps/synthesize/photo_database.h"
#include "holba/base/error.h"
#include "holba/base/log.h"
#include "holba/base/temporary_paths.h"
#include "holba/base/words.h"
#include "holba/io/database.h"
#include "holba/io/files.h"
#include "holba/io/model_io.h"
#include "holba/synthetic/bundle_problem.h"
#include "holba/synthetic/photo_set.h"

namespace holba {
namespace {

namespace fs = std::filesystem;

class SynthesizeJob : public Job {
 public:
  void Describe(OptionTable* table) const override {
    table->Field(
        "output_path", &output_path_,
        "Folder to write the models `truth` and `perturbed` to; with a database the folder "
        "of the true model (empty: none).");
    table->Field("database_path", &database_path_,
                 "Make a COLMAP database of a set of photographs instead: a file that does not "
                 "exist yet.");
    table->Choice("output_type", &output_type_,
                  {{"txt", ModelFormat::kText}, {"bin", ModelFormat::kBinary}},
                  "Format of the output.");
    options_.Describe(table);
    table->Section("Database");
    table
        ->Choice(
            "scene", &photos_.scene,
            {{"sphere", PhotoSceneKind::kSphere},
             {"street", PhotoSceneKind::kStreet},
             {"collection", PhotoSceneKind::kCollection}},
            "What the photographs are of (the cube of the adjustment problems from all around; "
            "a walk around a block of houses; visitors' photographs of a church).")
        .Basic();
    table
        ->Choice(
            "geometry", &geometry_,
            {{"truth", GeometrySource::kTruth}, {"estimated", GeometrySource::kEstimated}},
            "Two-view geometries (the true one fitted to the verified matches; found in the raw "
            "matches as `match` does it, 2 ms for each pair).")
        .Basic();
    table->Field("num_threads", &photos_.num_threads, AtLeast(-1),
                 "Number of threads; -1: one per hardware thread. The result does not depend on "
                 "it.");
    photos_.Describe(table);
  }

  void ProbeOutputs(const Invocation&) const override {
    if (!database_path_.empty()) {
      ProbeDatabase(database_path_);
      if (!output_path_.empty()) ProbeModelFolder(output_path_);
      return;
    }
    if (output_path_.empty()) {
      throw InputError(
          "--output_path or --database_path: one of the two must be given, a folder for models or "
          "the file of a database");
    }
    const fs::path folder = output_path_;
    ProbeFolder(folder, [](std::string_view) { return false; });
    ProbeModelFolder(folder / kTruth);
    ProbeModelFolder(folder / kPerturbed);
  }

  void Run(const Invocation&) override {
    if (database_path_.empty()) {
      CheckOptionsOfModels();
      MakeModels();
    } else {
      CheckOptionsOfDatabase();
      MakeDatabase();
    }
  }

 private:
  static constexpr std::string_view kTruth = "truth", kPerturbed = "perturbed";

  void CheckOptionsOfModels() const {
    const PhotoSetOptions defaults;
    if (photos_.scene == defaults.scene && photos_.num_threads == defaults.num_threads &&
        geometry_ == GeometrySource::kTruth && TextOfOptions(photos_) == TextOfOptions(defaults)) {
      return;
    }
    throw InputError(
        "--Database.*: these options must go with --database_path, as they say what is in a "
        "database");
  }

  void CheckOptionsOfDatabase() const {
    BundleProblemOptions others;
    others.seed = options_.seed;
    others.num_images = options_.num_images;
    if (TextOfOptions(options_) == TextOfOptions(others)) return;
    throw InputError(
        "--database_path: expected only --num_images, --seed and --Database.* beside it, found an "
        "option of adjustment problems");
  }

  void MakeModels() const {
    const SyntheticProblem problem = MakeBundleProblem(options_);
    // Both at once: a truth beside the start of another scene would be taken for its own.
    StagedFolder stage(output_path_);
    StageModel(problem.truth, output_type_, std::string(kTruth) + '/', &stage);
    StageModel(problem.perturbed, output_type_, std::string(kPerturbed) + '/', &stage);
    stage.Commit([](std::string_view name) {
      const size_t slash = name.find('/');
      if (slash == std::string_view::npos) return false;
      const std::string_view folder = name.substr(0, slash);
      return (folder == kTruth || folder == kPerturbed) && IsModelFile(name.substr(slash + 1));
    });
    const Reconstruction& model = problem.truth;
    LogInfo("Wrote the models truth and perturbed, each of {}, to {}", ContentsText(model),
            output_path_);
  }

  void MakeDatabase() {
    photos_.seed = options_.seed;
    photos_.num_images = options_.num_images;
    {
      const Database database(database_path_);
      if (!database.ReadImages().empty()) {
        throw InputError(database_path_,
                         "expected a database without images, as a synthetic one is made whole, "
                         "found one with images; give another path, or remove it");
      }
    }
    // Until it is whole: SQLite's own files beside it, too.
    TemporaryPath file(database_path_), log(database_path_ + "-wal"),
        index(database_path_ + "-shm");
    const PhotoSet set = MakePhotoSet(photos_);
    if (!output_path_.empty()) WriteModel(set.truth, output_path_, output_type_);
    PhotoDatabaseReport report;
    {
      Database database(database_path_);
      report = WritePhotoDatabase(set, geometry_, photos_.num_threads, &database);
    }
    file.Keep();
    LogInfo("Wrote {} with {} and {} in {} to {}", Counted(set.images.size(), "image"),
            Counted(NumKeypoints(set), "keypoint"), Counted(report.num_inliers, "verified match"),
            Counted(report.num_pairs, "pair"), database_path_);
    if (!output_path_.empty())
      LogInfo("Wrote the true model, {}, to {}", ContentsText(set.truth), output_path_);
  }

  static size_t NumKeypoints(const PhotoSet& set) {
    size_t count = 0;
    for (const PhotoSetImage& image : set.images) count += image.keypoints.size();
    return count;
  }

  std::string output_path_;
  std::string database_path_;
  ModelFormat output_type_ = ModelFormat::kBinary;
  BundleProblemOptions options_;
  PhotoSetOptions photos_;
  GeometrySource geometry_ = GeometrySource::kTruth;
};

}  // namespace

Command SynthesizeCommand() {
  return {.name = "synthesize",
          .summary = "Make a synthetic adjustment problem or database with ground truth",
          .details =
              "Writes two models with the same ids and the same noisy observations: "
              "OUTPUT_PATH/truth with the true poses and structure, and OUTPUT_PATH/perturbed, the "
              "start of an adjustment. The scene is the paper's synthetic benchmark: cameras on a "
              "sphere around a cube with axis-aligned planes, points and lines; f 700 px, "
              "1000 x 1000 px images; each feature seen by 4 to 8 of them.\n\n"
              "With --database_path it makes what extraction and matching of photographs would "
              "give instead: a COLMAP database with keypoints, raw and verified matches, segments "
              "and their matches, vanishing points and label maps, for mappers; and in OUTPUT_PATH "
              "the true model, whose tracks name these keypoints and segments. Of the other "
              "options --num_images, --seed and --Database.* say what is in it.",
          .supports_json = false,
          .make_job = [] { return std::make_unique<SynthesizeJob>(); }};
}

}  // namespace holba
