// SPDX-License-Identifier: BSD-3-Clause
// holba refine: structure for a posed model.
#include "holba/sfm/refine.h"

#include <filesystem>
#include <map>
#include <set>
#include <string>
#include <string_view>

#include "apps/command.h"
#include "apps/refine/refine_stage.h"
#include "apps/refine/report.h"
#include "apps/report.h"
#include "holba/base/error.h"
#include "holba/base/file_faults.h"
#include "holba/base/log.h"
#include "holba/base/timer.h"
#include "holba/base/words.h"
#include "holba/bundle/plausibility.h"
#include "holba/bundle/uncertainty.h"
#include "holba/estimation/lines/line_leave_one_out.h"
#include "holba/frontend/photographs/opencv_threads.h"
#include "holba/io/database.h"
#include "holba/io/files.h"
#include "holba/io/model_io.h"
#include "holba/io/uncertainty_file.h"
#include "holba/pipeline/camera_sizes.h"
#include "holba/pipeline/colours.h"
#include "holba/pipeline/detection.h"
#include "holba/pipeline/match_lines.h"
#include "holba/pipeline/output.h"
#include "holba/pipeline/photograph_folder.h"
#include "holba/pipeline/regions.h"
#include "holba/pipeline/view_output.h"

namespace holba {
namespace {

class RefineJob : public Job {
 public:
  void Describe(OptionTable* table) const override {
    table->Field("image_path", &image_path_, "Folder of the photographs.").Required();
    table->Field("input_path", &input_path_, "Model with poses and points (COLMAP's).").Required();
    table
        ->Field("output_path", &output_path_,
                "Folder of the holistic model, pictures and structure.ply.")
        .Required();
    table->Field("database_path", &database_path_,
                 "COLMAP database for what is found in the photographs, for the next run; empty: "
                 "database.db in the output folder.");
    table->Choice("output_type", &format_,
                  {{"txt", ModelFormat::kText}, {"bin", ModelFormat::kBinary}},
                  "Format of the model folder.");
    table->Field("num_pictures", &num_pictures_, AtLeast(-1),
                 "Photographs that are drawn upon, evenly spread over the model; -1: all.");
    table->Field("view", &view_,
                 "Whether view.html is written, a page that shows the model in a browser.");
    photographs_in_view_.Describe(table);
    table->Field("covariances", &covariances_,
                 "Whether covariances.txt is written (of poses, points, lines and groups).");
    read_.Describe(table);
    detection_.Describe(table);
    matching_.Describe(table);
    regions_.Describe(table);
    refine_.Describe(table);
  }

  void ProbeOutputs(const Invocation&) const override {
    ProbeFolder(output_path_, IsFile);
    ProbeDatabase(DatabasePath());
    ProbeResult();
  }

  void Run(const Invocation& invocation) override {
    const Timer timer;
    Reconstruction model = Read();
    RefineOutput output;
    Refine(&model, &output);
    WarnOfWhatWasHeld(output.refine.points_alone);
    WarnOfDoubts("After the adjustment", model);
    Write(model, &output);
    output.total_seconds = timer.Seconds();
    PrintResult(invocation.json ? JsonText(RefineToJson(output, model))
                                : RefineToText(output, model));
  }

 private:
  static constexpr const char* kCovariances = "covariances.txt";

  // What is written into the output folder, but for pictures and the database.
  static bool IsFile(std::string_view name) {
    return IsModelFile(name) || IsPly(name) || IsViewPage(name) || name == kCovariances;
  }

  std::filesystem::path DatabasePath() const {
    return database_path_.empty() ? std::filesystem::path(output_path_) / "database.db"
                                  : std::filesystem::path(database_path_);
  }

  static std::set<image_t> WithoutPhotograph(const RefineOutput& output) {
    std::set<image_t> images;
    for (const LeftOutPhotograph& photograph : output.detection.left_out)
      images.insert(photograph.image_id);
    return images;
  }

  // Throws InputError for what cannot be refined, before anything is computed or written.
  Reconstruction Read() const {
    if (!std::filesystem::is_directory(image_path_))
      throw NoSuchFolder(image_path_, "--image_path");
    detection_.Check();
    if (!detection_.imports.correspondences.empty() && regions_.matching != RegionMatching::kWarp) {
      throw InputError(
          "--Import.correspondences_path must go with --Regions.matching warp, as votes of "
          "features do not use it");
    }
    Reconstruction model = ReadModel(input_path_, read_);
    if (model.images.empty() || model.points3D.empty()) {
      throw InputError(
          input_path_,
          std::string("this model has no images or no points, on which structure is built; ") +
              kTriangulateFirst);
    }
    RefuseWithoutResiduals(input_path_, model);
    WarnOfDoubts("Before the adjustment", model);
    return model;
  }

  void Refine(Reconstruction* model, RefineOutput* output) {
    const int num_threads = refine_.solver.num_threads;
    detection_.num_threads = matching_.num_threads = num_threads;
    detection_.strict = read_.strict;
    HoldOpenCvThreads();
    photographs_ = PhotographFolder(image_path_, *model);
    if (const size_t num_cameras = TakeSizesFromPhotographs(photographs_, model); num_cameras > 0) {
      LogInfo("The sizes of {} are those of the photographs", Counted(num_cameras, "camera"));
    }

    const std::filesystem::path database_path = DatabasePath();
    Database database(database_path);
    FoundInImages found;
    found.database_id = database.MatchImages(*model, CheckDatabase(database, photographs_, *model));
    found.features = DetectFeatures(detection_, photographs_, *model, found.database_id, &database,
                                    &found.imported, &output->detection);
    LogInfo("{}", DetectionText(output->detection, database_path));
    RunRefine({detection_, matching_, regions_, refine_}, found, &database, model, output);
    if (model->lines3D.empty()) {
      LogWarning(
          "No 3D lines were found that {} or more images see; the report says where they were "
          "lost, under \"Not taken, and why\"",
          refine_.structure.lines.min_images);
    }
    output->leave_one_out = LeaveOneOut(*model, 4, num_threads);

    const Timer colour_timer;
    std::vector<point3D_t> made = output->refine.structure.corners.point3D_ids;
    for (const Junction& junction : output->refine.structure.junctions.junctions)
      made.push_back(junction.point3D_id);
    ColourFeatures(photographs_, made, num_threads, model, WithoutPhotograph(*output));
    output->write_seconds = colour_timer.Seconds();
  }

  void Write(const Reconstruction& model, RefineOutput* output) const {
    const Timer timer;
    // All that belongs to the output is prepared beside it and put in place at once.
    StagedFolder stage(output_path_);
    StageModel(model, format_, "", &stage);
    StageStructurePly(model, "", &stage);
    if (covariances_) {
      const auto uncertainty = EstimateUncertainty(
          model, output->refine.stage1_options, output->refine.stage1, refine_.solver.num_threads);
      if (uncertainty) {
        stage.Write(kCovariances,
                    [&](std::ostream* stream) { FormatUncertainty(*uncertainty, stream); });
      } else {
        LogWarning(
            "The file covariances.txt was not written, as the observations do not determine all "
            "poses, points and lines");
      }
    }
    StagePictures(model, photographs_, WithoutPhotograph(*output), num_pictures_,
                  refine_.solver.num_threads, "", &stage);
    if (view_) {
      StageViewPage(model, &photographs_, WithoutPhotograph(*output), photographs_in_view_,
                    refine_.solver.num_threads, "", &stage);
    }
    stage.Commit([](std::string_view name) { return IsFile(name) || IsPictureFolder(name); });
    if (view_) LogViewPage(output_path_);
    output->write_seconds += timer.Seconds();
  }

  std::string image_path_, input_path_, output_path_, database_path_;
  ModelFormat format_ = ModelFormat::kBinary;
  int num_pictures_ = 4;
  bool covariances_ = false;
  bool view_ = true;
  ViewPhotographOptions photographs_in_view_;
  ReadModelOptions read_;
  DetectionOptions detection_;
  MatchLinesOptions matching_;
  RegionOptions regions_;
  RefineOptions refine_;
  PhotographFolder photographs_{""};
};

}  // namespace

Command RefineCommand() {
  return {.name = "refine",
          .summary = "Build lines, groups and wireframe on a posed model, and adjust all of it",
          .details =
              "Finds line segments, corners and vanishing points in the photographs, builds 3D "
              "lines, planes, vanishing\n"
              "points, junctions and the wireframe on the model's poses, adjusts everything, and "
              "writes a model that\n"
              "COLMAP opens, with pictures and a PLY beside it. What is found in photographs is "
              "kept in the database;\n"
              "a second run starts from it.",
          .supports_json = true,
          .make_job = [] { return std::make_unique<RefineJob>(); }};
}

}  // namespace holba
