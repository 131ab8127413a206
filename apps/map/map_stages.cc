// SPDX-License-Identifier: BSD-3-Clause
#include "apps/map/map_stages.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <map>
#include <optional>
#include <set>
#include <utility>
#include <vector>

#include "apps/command.h"
#include "apps/map/snapshot.h"
#include "apps/refine/refine_stage.h"
#include "holba/base/error.h"
#include "holba/base/log.h"
#include "holba/base/printable.h"
#include "holba/base/progress.h"
#include "holba/base/timer.h"
#include "holba/base/words.h"
#include "holba/bundle/bundle_problem.h"
#include "holba/frontend/photographs/opencv_threads.h"
#include "holba/io/files.h"
#include "holba/io/model_io.h"
#include "holba/pipeline/colours.h"
#include "holba/pipeline/output.h"
#include "holba/pipeline/photograph_folder.h"
#include "holba/pipeline/view_output.h"
#include "holba/sfm/snapshot_archive.h"

namespace holba {
namespace {

constexpr const char* kReportText = "report.txt";
constexpr const char* kReportJson = "report.json";

// Progress on a terminal, now and then a sentence on the log and a snapshot.
class MapProgress : public MapObserver {
 public:
  // `snapshot_seconds`: least time between two.
  MapProgress(size_t num_images, double snapshot_seconds, SnapshotFile* file)
      : snapshot_seconds_(snapshot_seconds),
        file_(*file),
        progress_("Mapping", "images", num_images) {}

  void OnImage(const MapperState& state, image_t, const std::string& sentence) override {
    progress_.Update(state.model().images.size());
    if (timer_.Seconds() < next_message_seconds_) return;
    next_message_seconds_ = timer_.Seconds() + kSecondsBetweenMessages;
    LogInfo("{}", sentence);
  }

  bool WantsSnapshot() override { return timer_.Seconds() >= next_snapshot_seconds_; }

  void OnSnapshot(const std::string& bytes) override {
    const double begin = timer_.Seconds();
    file_.Write(bytes);
    const double end = timer_.Seconds();
    next_snapshot_seconds_ =
        end + std::max(snapshot_seconds_, (end - begin) / kMaxShareOfSnapshots);
    LogDebug("Snapshot of {} bytes in {:.3f} s", bytes.size(), end - begin);
  }

 private:
  static constexpr double kSecondsBetweenMessages = 5.0;
  static constexpr double kMaxShareOfSnapshots = 0.01;  // of the time
  double snapshot_seconds_;
  SnapshotFile& file_;
  Progress progress_;
  Timer timer_;
  double next_message_seconds_ = kSecondsBetweenMessages;
  double next_snapshot_seconds_ = 0.0;
};

// What has no pose is the database's, not the model's.
void RemoveUnregistered(Reconstruction* model) {
  model->unregistered_images = {};
  model->unregistered_frames = {};
  std::set<camera_t> cameras;
  std::set<rig_t> rigs;
  for (const auto& [id, image] : model->images) cameras.insert(image.camera_id);
  for (const auto& [id, frame] : model->frames) rigs.insert(frame.rig_id);
  model->rigs.RemoveIf([&](rig_t id, const Rig&) { return !rigs.contains(id); });
  for (const auto& [id, rig] : model->rigs) {
    for (const Rig::Sensor& sensor : rig.sensors) {
      if (sensor.id.type == SensorType::kCamera) cameras.insert(sensor.id.id);
    }
    if (rig.ref_sensor && rig.ref_sensor->type == SensorType::kCamera)
      cameras.insert(rig.ref_sensor->id);
  }
  model->cameras.RemoveIf([&](camera_t id, const Camera&) { return !cameras.contains(id); });
}

// By reason, as many images often have the same one.
void WarnOfLeftOut(const MapOutput& output) {
  constexpr size_t kMaxNumNamed = 10;
  std::map<std::string, std::vector<std::string>> names;
  for (const auto& [name, reason] : output.left_out) names[reason].push_back(name);
  for (auto& [reason, of_reason] : names) {
    const size_t count = of_reason.size();
    of_reason.resize(std::min(count, kMaxNumNamed));
    LogWarning("Not in a model: {}{}: {}", fmt::join(of_reason, ", "),
               count > kMaxNumNamed ? fmt::format(" and {} more", count - kMaxNumNamed) : "",
               reason);
  }
}

[[noreturn]] void RefuseWithoutModel(const std::filesystem::path& database_path,
                                     const MapOutput& output) {
  std::string reasons;
  for (const auto& [reason, count] : output.initial_pairs.dropped)
    reasons += fmt::format("{}{}: {}", reasons.empty() ? "" : ", ", reason, count);
  throw InputError(
      database_path,
      fmt::format("no pair of its {} could begin a model ({}); add photographs that show the same "
                  "from places apart, match more of them, or lower --Mapper.init_min_num_inliers",
                  Counted(output.num_images, "image"),
                  reasons.empty() ? "no pair has enough verified matches" : reasons));
}

// "12/images.bin" -> "images.bin"; empty: not in a numbered folder.
std::optional<std::string_view> InNumberedFolder(std::string_view name) {
  const size_t slash = name.find('/');
  const std::string_view folder = name.substr(0, slash);
  if (folder.empty() ||
      !std::all_of(folder.begin(), folder.end(), [](char c) { return c >= '0' && c <= '9'; }))
    return std::nullopt;
  return slash == std::string_view::npos ? std::string_view() : name.substr(slash + 1);
}

// Models of an earlier run that had more of them.
void RemoveEmptyFolders(const std::filesystem::path& output) {
  std::error_code ignored;
  std::vector<std::filesystem::path> folders;
  for (std::filesystem::directory_iterator entry(output, ignored), end; entry != end;
       entry.increment(ignored)) {
    if (InNumberedFolder(entry->path().filename().string()) && entry->is_directory(ignored))
      folders.push_back(entry->path());
  }
  // Only what is empty can be removed so.
  for (const std::filesystem::path& folder : folders)
    if (std::filesystem::is_empty(folder, ignored)) std::filesystem::remove(folder, ignored);
}

}  // namespace

void ProbeModels(const std::filesystem::path& folder) {
  ProbeFolder(folder, [](std::string_view) { return false; });
}

bool IsOfModels(std::string_view name) {
  if (name == kReportText || name == kReportJson) return true;
  const auto inside = InNumberedFolder(name);
  return inside && (IsModelFile(*inside) || IsPly(*inside) || IsViewPage(*inside) ||
                    IsPictureFolder(*inside));
}

MapReports ReportsOf(const MapOutput& output) { return {MapToText(output), MapToJson(output)}; }

void MapStages::Describe(OptionTable* table) const {
  DescribeWithoutPhotographs(table);
  table->Section("");
  table
      ->Field("mask_path", &detection_.mask_path,
              "Folder of masks, as COLMAP's --ImageReader.mask_path: no structure where the image "
              "NAME.png is 0.")
      .Advanced();
}

void MapStages::DescribeWithoutPhotographs(OptionTable* table) const {
  table->Section("");
  table->Choice("output_type", &format_,
                {{"txt", ModelFormat::kText}, {"bin", ModelFormat::kBinary}},
                "Format of the model folders.");
  table->Field(
      "refine", &refine_models_,
      "Whether models are refined at the end, as by 'holba refine': structure of all images, "
      "weights chosen by points left out, intrinsics as far as they are determined.");
  table->Field("num_pictures", &num_pictures_, AtLeast(-1),
               "Photographs that are drawn upon, evenly spread over each model; -1: all.");
  table->Field("view", &view_,
               "Whether view.html is written into each model's folder, a page that shows the model "
               "in a browser.");
  photographs_in_view_.Describe(table);
  table
      ->Field("align_to_positions", &align_to_positions_,
              "Whether models are put where the positions of their images say (GPS in EXIF, or of "
              "the database), in metres, if these are exact enough for that.")
      .Advanced();
  table->Field("resume", &resume_,
               "Whether a stopped run to the same place goes on, to the same result.");
  table
      ->Field("snapshot_seconds", &snapshot_seconds_, AtLeast(0),
              "Least time in seconds between two snapshots for that.")
      .Advanced();
  mapper_.Describe(table);
  detection_.DescribeStructure(table);
  matching_.Describe(table);
  regions_.Describe(table);
  refine_.Describe(table);
}

void MapStages::SetPhotographs(const std::string& mask_path, const std::string& camera_mask_path,
                               bool strict) {
  detection_.mask_path = mask_path;
  detection_.camera_mask_path = camera_mask_path;
  detection_.strict = strict;
}

LineMatchingOptions MapStages::SegmentMatching() const {
  LineMatchingOptions options = matching_.matching;
  if (options.num_near_points == 0) options.num_near_points = kNearPointsWithoutPoses;
  return options;
}

void MapStages::Check() const { detection_.Check(); }

MappingData MapStages::Read(const MapPaths& paths, Database* database) const {
  const MappingDataOptions options{
      .selection = {static_cast<size_t>(mapper_.min_num_matches), mapper_.ignore_watermarks},
      .structure = mapper_.structure != MapperStructure::kNone,
      .num_threads = num_threads()};
  const std::filesystem::path photographs = paths.image_path;
  MappingData data = ReadMappingData(options, detection_, SegmentMatching(),
                                     paths.image_path.empty() ? nullptr : &photographs, database);
  LogInfo(
      "{} with {} of keypoints and {} of segments",
      Counted(data.scene.unregistered_images.size(), "image"),
      Counted(database->VerifiedPairs(options.selection.min_num_matches).size(), "verified pair"),
      Counted(data.segments.num_mutual, "match"));
  return data;
}

MapOutput MapStages::Run(const MapPaths& paths,
                         const std::function<MapReports(const MapOutput&)>& reports) {
  const Timer timer;
  Check();
  detection_.num_threads = matching_.num_threads = num_threads();
  HoldOpenCvThreads();
  MapOutput output;
  std::vector<Reconstruction> models;
  std::set<image_t> without_photograph;
  {
    Database database(paths.database_path);
    MappingData data = Read(paths, &database);
    if (!paths.input_path.empty()) output.continued = Continue(paths.input_path, &data.scene);
    without_photograph = data.without_photograph;
    output.num_images = data.scene.images.size() + data.scene.unregistered_images.size();
    output.read_seconds = timer.Seconds();

    const Timer map_timer;
    mapper_.structure_options = refine_.structure;
    mapper_.structure_options.SetNumThreads(num_threads());
    mapper_.cameras = refine_.bundle;
    SnapshotFile snapshot(paths.output_path, OptionsText(),
                          FingerprintOf(data.input.graph, data.scene));
    const std::string start = Start(snapshot);
    MapProgress progress(output.num_images, snapshot_seconds_, &snapshot);
    MapResult result = MapImages(mapper_, refine_.solver, data.input, data.scene, &progress, start);
    output.map_seconds = map_timer.Seconds();
    output.initial_pairs = std::move(result.initial_pairs);
    for (const auto& [id, reason] : result.left_out)
      output.left_out.emplace_back(data.scene.FindImage(id)->name, reason);
    WarnOfLeftOut(output);
    if (result.models.empty()) RefuseWithoutModel(paths.database_path, output);
    for (MappedModel& mapped : result.models) {
      RemoveUnregistered(&mapped.model);
      MapOutput::OfModel& of_model = output.models.emplace_back();
      of_model.map = std::move(mapped.report);
      const Timer refine_timer;
      if (refine_models_) Refine(paths, data, &database, &mapped.model, &of_model);
      // A model that is continued stays where it is.
      if (align_to_positions_ && paths.input_path.empty())
        of_model.alignment = AlignToPositions(database.ReadPosePriors(), &mapped.model);
      output.refine_seconds += refine_timer.Seconds();
      UpdateErrors(&mapped.model);
      CountModel(mapped.model, &of_model);
      models.push_back(std::move(mapped.model));
    }
  }
  output.total_seconds = timer.Seconds();
  Write(paths, reports(output), without_photograph, models);
  SnapshotFile(paths.output_path, "", 0).Remove();
  return output;
}

ContinueReport MapStages::Continue(const std::filesystem::path& input_path,
                                   Reconstruction* scene) const {
  const Reconstruction model = ReadModel(input_path);
  const ContinueReport report = ContinueModel(model, input_path, scene);
  LogInfo("{} with {} of the model, {} without a pose yet", Counted(report.num_images, "image"),
          Counted(report.num_points, "point"),
          Counted(scene->unregistered_images.size(), "other image"));
  if (report.num_lines_and_groups_left_out > 0) {
    LogInfo("Lines, groups and what was made from them ({} of the model) are built anew",
            report.num_lines_and_groups_left_out);
  }
  if (report.num_foreign_observations > 0) {
    LogWarning("{} of the model at places that are no keypoints of the database {} left out",
               Counted(report.num_foreign_observations, "observation"),
               Agree(report.num_foreign_observations, "is", "are"));
  }
  return report;
}

std::string MapStages::OptionsText() const {
  // What the result of the mapper does not depend on.
  static const std::set<std::string> others = {"output_type",
                                               "num_pictures",
                                               "refine",
                                               "resume",
                                               "view",
                                               "photograph_px",
                                               "max_photographs_mb",
                                               "align_to_positions",
                                               "snapshot_seconds",
                                               "Solver.num_threads"};
  OptionTable table;
  DescribeWithoutPhotographs(&table);
  std::string text;
  for (const Option& option : table.options()) {
    if (!others.contains(option.name)) text += option.name + "=" + option.Text() + "\n";
  }
  return text;
}

std::string MapStages::Start(const SnapshotFile& snapshot) const {
  if (!resume_) {
    if (snapshot.Exists()) {
      LogWarning(
          "An earlier run to this place did not end; this one begins anew, --resume 1 would go on "
          "from where that one was");
      snapshot.Remove();
    }
    return "";
  }
  if (auto state = snapshot.Read()) {
    LogInfo("Going on from the last snapshot of the run before");
    return *state;
  }
  LogInfo("There is no snapshot of an earlier run to go on from, so this one begins at the start");
  return "";
}

void MapStages::Write(const MapPaths& paths, const MapReports& reports,
                      const std::set<image_t>& without_photograph,
                      const std::vector<Reconstruction>& models) const {
  StagedFolder stage(paths.output_path);
  for (size_t i = 0; i < models.size(); ++i) {
    const std::string folder = std::to_string(i) + "/";
    StageModel(models[i], format_, folder, &stage);
    StageStructurePly(models[i], folder, &stage);
    std::optional<PhotographFolder> photographs;
    if (!paths.image_path.empty()) photographs.emplace(paths.image_path, models[i]);
    if (view_) {
      StageViewPage(models[i], photographs ? &*photographs : nullptr, without_photograph,
                    photographs_in_view_, num_threads(), folder, &stage);
    }
    if (!photographs) continue;
    StagePictures(models[i], *photographs, without_photograph, num_pictures_, num_threads(), folder,
                  &stage);
  }
  stage.Write(kReportText, [&](std::ostream* stream) { *stream << Printable(reports.text); });
  stage.Write(kReportJson, [&](std::ostream* stream) { *stream << JsonText(reports.json); });
  stage.Commit(IsOfModels);
  RemoveEmptyFolders(paths.output_path);
  if (view_ && !models.empty()) LogViewPage(std::filesystem::path(paths.output_path) / "0");
}

void MapStages::Refine(const MapPaths& paths, const MappingData& data, Database* database,
                       Reconstruction* model, MapOutput::OfModel* report) const {
  RefineOutput& output = report->refine.emplace();
  RefineOptions options = refine_;
  if (mapper_.fix_existing_frames && !paths.input_path.empty()) options.fix_poses = true;
  if (mapper_.structure != MapperStructure::kHolistic)
    options.bundle.config = ConfigOf(mapper_.structure);
  // What was held while the model grew is known: also the principal point, if all else is.
  const GlobalAdjustmentOptions& grown = mapper_.global;
  if (!grown.refine_focal_length) options.bundle.refine_focal_length = false;
  if (!grown.refine_extra_params) options.bundle.refine_extra_params = false;
  if (!grown.refine_sensor_from_rig) options.bundle.refine_sensor_from_rig = false;
  if (!grown.refine_focal_length && !grown.refine_extra_params && !grown.refine_principal_point)
    options.bundle.refine_principal_point = false;
  FoundInImages found;
  for (const auto& [id, image] : model->images) found.database_id[id] = id;
  const bool has_photographs = !paths.image_path.empty();
  const PhotographFolder photographs =
      has_photographs ? PhotographFolder(paths.image_path, *model) : PhotographFolder("");
  if (mapper_.structure != MapperStructure::kNone) {
    if (has_photographs) {
      // The cameras are better known now, and with them what is straight.
      found.features = DetectFeatures(detection_, photographs, *model, found.database_id, database,
                                      &found.imported, &output.detection);
    } else {
      for (const auto& [id, of_image] : data.input.features) {
        if (model->images.contains(id)) found.features[id] = of_image;
      }
    }
  }
  RunRefine({detection_, matching_, regions_, options}, found, database, model, &output);
  if (!has_photographs) return;
  std::vector<point3D_t> points;
  for (const auto& [id, point] : model->points3D) points.push_back(id);
  ColourFeatures(photographs, points, refine_.solver.num_threads, model, data.without_photograph);
}

}  // namespace holba
