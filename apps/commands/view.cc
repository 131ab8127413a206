// SPDX-License-Identifier: BSD-3-Clause
// holba view: a model as one page for a browser.
#include <filesystem>
#include <set>
#include <string>
#include <string_view>
#include <utility>

#include "apps/command.h"
#include "apps/report.h"
#include "apps/view/open_in_browser.h"
#include "holba/base/error.h"
#include "holba/base/file_faults.h"
#include "holba/base/log.h"
#include "holba/evaluation/alignment.h"
#include "holba/evaluation/image_pairing.h"
#include "holba/io/bal.h"
#include "holba/io/files.h"
#include "holba/io/model_io.h"
#include "holba/scene/reconstruction.h"
#include "holba/view/view_model.h"
#include "holba/view/view_page.h"
#include "holba/view/view_title.h"
#if defined(HOLBA_WITH_FRONTEND)
#include "holba/pipeline/output.h"
#include "holba/pipeline/photograph_folder.h"
#include "holba/pipeline/view_output.h"
#endif

namespace holba {
namespace {

namespace fs = std::filesystem;

class ViewJob : public Job {
 public:
  void Describe(OptionTable* table) const override {
    table->Field("input_path", &input_path_, "Model folder (COLMAP's, too), or a BAL file.")
        .Required();
    table->Field("output_path", &output_path_,
                 "HTML file; empty: one in a temporary place, which a browser is told to open.");
#if defined(HOLBA_WITH_FRONTEND)
    table->Field("image_path", &image_path_, "Folder of the photographs; empty: without them.");
    table->Field("picture_path", &picture_path_,
                 "Folder for pictures (PNG): overview, plan, along the directions, photographs "
                 "drawn upon; with it and without --output_path there is no page.");
    table->Field("num_pictures", &num_pictures_, AtLeast(-1),
                 "Photographs that are drawn upon for --picture_path, evenly spread over the "
                 "model; -1: all.");
    table
        ->Field("unit_name", &unit_name_,
                "What a length of 1 of the model is, for the bars of pictures (m); empty: units.")
        .Advanced();
#endif
    table->Field("compare_path", &compare_path_,
                 "Second model, shown with the first after alignment: before, after, truth.");
    table->Field("report_path", &report_path_,
                 "Text for the report's tab; empty: report.txt in the model's folder or the one "
                 "above, if there is any.");
#if defined(HOLBA_WITH_FRONTEND)
    photographs_.Describe(table);
#endif
    table
        ->Field("max_model_mb", &max_model_mb_, GreaterThan(0),
                "Megabytes of numbers above which the page leaves out where keypoints and segments "
                "were seen.")
        .Advanced();
    table->Field("num_threads", &num_threads_, AtLeast(-1), "Threads; -1: one per hardware thread.")
        .Advanced();
    read_.Describe(table);
  }

  void ProbeOutputs(const Invocation&) const override {
    if (!output_path_.empty()) ProbeFile(output_path_);
#if defined(HOLBA_WITH_FRONTEND)
    if (!picture_path_.empty()) ProbeFolder(picture_path_, IsScenePicture);
#endif
  }

  void Run(const Invocation&) override {
    const Reconstruction model = Read(input_path_);
#if defined(HOLBA_WITH_FRONTEND)
    if (!picture_path_.empty()) {
      WritePictures(model);
      if (output_path_.empty()) return;
    }
#endif
    const Eigen::Vector3d origin = OriginOfView(model);
    ViewPage page;
    const ViewModel shown = MakeViewModel(model, Options(input_path_, Report()), origin);
    if (!shown.has_observed_positions) {
      LogWarning(
          "The page does not hold where keypoints and segments were seen in the images, as these "
          "are many; a greater --max_model_mb would");
    }
    page.model = shown.bytes;
    if (!compare_path_.empty())
      page.compare = MakeViewModel(ReadAligned(model), Options(compare_path_, ""), origin).bytes;
    AddPhotographs(model, &page);
    const fs::path path = output_path_.empty() ? TemporaryPage() : fs::path(output_path_);
    WriteFileWhole(path, [&](std::ostream* stream) { FormatViewPage(page, stream); });
    LogInfo("Wrote {} to {} ({:.1f} MB)", ContentsText(model), path.string(),
            static_cast<double>(fs::file_size(path)) / 1e6);
    if (output_path_.empty() && !OpenInBrowser(path))
      LogInfo("No browser was found to open it with; open {} in one", path.string());
  }

 private:
  Reconstruction Read(const std::string& path) const {
    if (fs::is_regular_file(path)) return ReadBal(path);
    // Also poses alone are something to look at.
    if (!FindModelFormat(path) && HoldsPoses(path)) return ReadPoses(path);
    return ReadModel(path, read_);
  }

  ViewModelOptions Options(const std::string& path, std::string report) const {
    return {.title = ViewTitle(path),
            .report = std::move(report),
            .num_threads = num_threads_,
            .max_num_bytes = static_cast<size_t>(max_model_mb_ * 1e6)};
  }

  std::string Report() const {
    if (!report_path_.empty()) return ReadFileBytes(report_path_);
    const fs::path whole = fs::absolute(input_path_).lexically_normal();
    const fs::path folder = whole.has_filename() ? whole : whole.parent_path();
    for (const fs::path& path : {folder / "report.txt", folder.parent_path() / "report.txt"}) {
      if (fs::is_regular_file(path)) return ReadFileBytes(path);
    }
    return "";
  }

  Reconstruction ReadAligned(const Reconstruction& model) const {
    Reconstruction other = Read(compare_path_);
    const ImagePairing pairing = PairImages(other, model);
    ReportPairing(pairing, input_path_);
    const auto alignment = AlignReconstructions(other, model, pairing, AlignmentBasis::kAuto);
    if (!alignment) {
      throw InputError(compare_path_,
                       "this model has no image in common with that of --input_path, so that they "
                       "cannot be aligned; give a model of the same photographs");
    }
    other.Transform(alignment->truth_from_model);
    return other;
  }

  void AddPhotographs(const Reconstruction& model, ViewPage* page) const {
#if defined(HOLBA_WITH_FRONTEND)
    if (image_path_.empty()) return;
    page->photographs =
        MakeViewPhotographs(model, Photographs(model), {}, photographs_, num_threads_);
#endif
  }

#if defined(HOLBA_WITH_FRONTEND)
  PhotographFolder Photographs(const Reconstruction& model) const {
    if (!fs::is_directory(image_path_)) throw NoSuchFolder(image_path_, "--image_path");
    return PhotographFolder(image_path_, model);
  }

  void WritePictures(const Reconstruction& model) const {
    StagedFolder stage(picture_path_);
    StageScenePictures(model, unit_name_, num_threads_, "", &stage);
    if (!image_path_.empty()) {
      const PhotographFolder photographs = Photographs(model);
      std::set<image_t> missing;
      for (const auto& [id, image] : model.images) {
        if (!fs::is_regular_file(photographs / image.name)) missing.insert(id);
      }
      StageImagePictures(model, photographs, missing, num_pictures_, PictureFormat::kPng,
                         num_threads_, std::string(kImagePictures) + "/", &stage);
    }
    stage.Commit(
        [](std::string_view name) { return IsScenePicture(name) || name == kImagePictures; });
    LogInfo("Wrote pictures to {}", picture_path_);
  }
#endif

  std::string input_path_, output_path_, image_path_, compare_path_, report_path_;
#if defined(HOLBA_WITH_FRONTEND)
  ViewPhotographOptions photographs_;
  std::string picture_path_, unit_name_;
  int num_pictures_ = 4;
#endif
  double max_model_mb_ = 45.0;
  int num_threads_ = -1;
  ReadModelOptions read_;
};

}  // namespace

Command ViewCommand() {
  return {.name = "view",
          .summary = "Write one page that shows a model in any browser",
          .details =
              "The page holds all that it shows and needs no network. Points, lines, groups, "
              "cameras and photographs can be\n"
              "turned around, coloured, picked and measured; press ? in it for its keys.",
          .make_job = [] { return std::make_unique<ViewJob>(); }};
}

}  // namespace holba
