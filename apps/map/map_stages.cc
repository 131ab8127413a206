// SPDX-License-Identifier: BSD-3-Clause
#include "apps/map/map_stages.h"

#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <set>
#include <utility>
#include <vector>

#include "holba/base/error.h"
#include "holba/base/log.h"
#include "holba/base/progress.h"
#include "holba/base/timer.h"
#include "holba/base/words.h"
#include "holba/bundle/bundle_problem.h"
#include "holba/estimation/lines/line_leave_one_out.h"
#include "holba/frontend/photographs/opencv_threads.h"
#include "holba/io/files.h"
#include "holba/io/model_io.h"
#include "holba/pipeline/colours.h"
#include "holba/pipeline/output.h"
#include "holba/pipeline/photograph_folder.h"

namespace holba {
namespace {

// Progress on a terminal, a sentence on the log else.
class MapProgress : public MapObserver {
 public:
  MapProgress(size_t num_images, bool quiet) : progress_("Mapping", "images", num_images, !quiet) {}
  void OnImage(const MapperState& state, image_t, const std::string& sentence) override {
    progress_.Update(state.model().images.size());
    if (timer_.Seconds() < next_message_seconds_) return;
    next_message_seconds_ = timer_.Seconds() + kSecondsBetweenMessages;
    progress_.Clear();
    LogInfo("{}", sentence);
  }

 private:
  static constexpr double kSecondsBetweenMessages = 5.0;
  Progress progress_;
  Timer timer_;
  double next_message_seconds_ = kSecondsBetweenMessages;
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

// "12/images.bin" -> "images.bin"; empty: not in a numbered folder.
std::optional<std::string_view> InNumberedFolder(std::string_view name) {
  const size_t slash = name.find('/');
  const std::string_view folder = name.substr(0, slash);
  if (folder.empty() ||
      !std::all_of(folder.begin(), folder.end(), [](char c) { return c >= '0' && c <= '9'; }))
    return std::nullopt;
  return slash == std::string_view::npos ? std::string_view() : name.substr(slash + 1);
}

}  // namespace

void ProbeModels(const std::filesystem::path& folder) {
  ProbeFolder(folder, [](std::string_view) { return false; });
}

bool IsOfModels(std::string_view name) {
  const auto inside = InNumberedFolder(name);
  return inside && (IsModelFile(*inside) || IsPly(*inside) || IsPictureFolder(*inside));
}

void MapStages::Describe(OptionTable* table) const {
  table->Choice("output_type", &format_,
                {{"txt", ModelFormat::kText}, {"bin", ModelFormat::kBinary}},
                "Format of the model folders.");
  table->Field(
      "refine", &refine_models_,
      "Whether models are refined at the end as by 'holba refine': structure of all images, "
      "weights chosen by points left out, intrinsics as far as they are determined.");
  table->Field("num_pictures", &num_pictures_, AtLeast(-1),
               "Photographs that are drawn upon, evenly spread over each model; -1: all.");
  mapper_.Describe(table);
  detection_.Describe(table);
  matching_.Describe(table);
  regions_.Describe(table);
  refine_.Describe(table);
}

MapOutput MapStages::Run(const MapPaths& paths) {
  const Timer timer;
  MapOutput output;
  const int num_threads = refine_.solver.num_threads;
  detection_.num_threads = matching_.num_threads = num_threads;
  detection_.Check();
  HoldOpenCvThreads();
  Database database(paths.database_path);
  const std::filesystem::path photographs = paths.image_path;
  const MappingDataOptions data_options{
      .min_num_matches = static_cast<size_t>(mapper_.min_num_matches),
      .ignore_watermarks = mapper_.ignore_watermarks,
      .structure = mapper_.structure != MapperStructure::kNone,
      .num_threads = num_threads};
  const MappingData data =
      ReadMappingData(data_options, detection_, matching_.matching,
                      paths.image_path.empty() ? nullptr : &photographs, &database);
  output.num_images = data.scene.unregistered_images.size();
  output.read_seconds = timer.Seconds();
  LogInfo("{} with {} of keypoints and {} of segments", Counted(output.num_images, "image"),
          Counted(database.VerifiedPairs(data_options.min_num_matches).size(), "verified pair"),
          Counted(data.segments.num_mutual, "match"));

  const Timer map_timer;
  mapper_.structure_options = refine_.structure;
  mapper_.structure_options.SetNumThreads(num_threads);
  MapProgress progress(output.num_images, paths.quiet);
  MapResult result = MapImages(mapper_, refine_.solver, data.input, data.scene, &progress);
  output.map_seconds = map_timer.Seconds();
  output.initial_pairs = result.initial_pairs;
  for (const auto& [id, reason] : result.left_out)
    output.left_out.emplace_back(data.scene.unregistered_images.at(id).name, reason);
  if (result.models.empty()) {
    std::string reasons;
    for (const auto& [reason, count] : result.initial_pairs.dropped)
      reasons += fmt::format("{}{}: {}", reasons.empty() ? "" : ", ", reason, count);
    throw InputError(
        paths.database_path,
        fmt::format("no pair of images could begin a model ({}); match more images, or "
                    "lower --Mapper.init_min_num_inliers and "
                    "--Mapper.init_min_tri_angle",
                    reasons.empty() ? "no pair has enough matches" : reasons));
  }

  StagedFolder stage(paths.output_path);
  for (size_t i = 0; i < result.models.size(); ++i) {
    Reconstruction& model = result.models[i].model;
    RemoveUnregistered(&model);
    const Timer refine_timer;
    MapOutput::OfModel report;
    if (refine_models_) Refine(paths, data, &model, &report);
    output.refine_seconds += refine_timer.Seconds();
    UpdateErrors(&model);
    std::optional<RefineOutput> refined = std::move(report.refine);
    report = CountsOf(model);
    report.refine = std::move(refined);
    report.map = std::move(result.models[i].report);
    output.models.push_back(std::move(report));
    StageModel(model, format_, std::to_string(i) + "/", &stage);
  }
  stage.Commit(IsOfModels);
  output.total_seconds = timer.Seconds();
  return output;
}

void MapStages::Refine(const MapPaths& paths, const MappingData& data, Reconstruction* model,
                       MapOutput::OfModel* report) const {
  RefineOutput& output = report->refine.emplace();
  RefineOptions options = refine_;
  switch (mapper_.structure) {
    case MapperStructure::kNone:
      options.bundle.config = BundleConfig::kPoint;
      break;
    case MapperStructure::kLines:
      options.bundle.config = BundleConfig::kPointLine;
      break;
    case MapperStructure::kGroups:
      options.bundle.config = BundleConfig::kGroups;
      break;
    case MapperStructure::kHolistic:
      break;
  }
  // What was held while the model grew is known: also the principal point, if all else is.
  const GlobalAdjustmentOptions& grown = mapper_.global;
  if (!grown.refine_focal_length) options.bundle.refine_focal_length = false;
  if (!grown.refine_extra_params) options.bundle.refine_extra_params = false;
  if (!grown.refine_sensor_from_rig) options.bundle.refine_sensor_from_rig = false;
  if (!grown.refine_focal_length && !grown.refine_extra_params && !grown.refine_principal_point)
    options.bundle.refine_principal_point = false;
  const auto log = [](const std::string& text) { LogInfo("{}", text); };
  Database database(paths.database_path);
  std::map<image_t, image_t> own_ids;
  for (const auto& [id, image] : model->images) own_ids[id] = id;
  std::map<image_t, ImportedSegments> imported;
  ImageFeatureMap features;
  const bool has_photographs = !paths.image_path.empty();
  const PhotographFolder photographs =
      has_photographs ? PhotographFolder(paths.image_path, *model) : PhotographFolder("");
  if (mapper_.structure != MapperStructure::kNone) {
    if (has_photographs) {
      // The cameras are better known now, and with them what is straight.
      features = DetectFeatures(detection_, photographs, *model, own_ids, &database, &imported,
                                &output.detection);
    } else {
      for (const auto& [id, of_image] : data.input.features) {
        if (model->images.contains(id)) features[id] = of_image;
      }
    }
  }
  LineMatchMap matches;
  const auto match_lines = [&](const Reconstruction& posed) {
    if (!features.empty()) {
      matches = MatchLines(matching_, detection_.imports.line_matches, posed, features, own_ids,
                           imported, &database, &output.matching);
    }
    return matches;
  };
  RegionObserver observe_regions;
  if (!detection_.imports.labels.empty()) {
    observe_regions = [&](Reconstruction* with_lines) {
      return ObserveRegions(regions_, detection_.imports.correspondences, features, matches,
                            with_lines, &output.regions);
    };
  }
  output.refine = RefineModel(options, features, match_lines, observe_regions, model, log);
  if (!has_photographs) return;
  std::vector<point3D_t> points;
  for (const auto& [id, point] : model->points3D) points.push_back(id);
  ColourFeatures(photographs, points, refine_.solver.num_threads, model, data.without_photograph);
}

}  // namespace holba
