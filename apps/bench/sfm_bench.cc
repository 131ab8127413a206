// SPDX-License-Identifier: BSD-3-Clause
#include "apps/bench/sfm_bench.h"

#include <fmt/format.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>

#include "apps/map/map_stages.h"
#include "apps/map/report.h"
#include "apps/synthesize/photo_database.h"
#include "apps/view/page_beside_truth.h"
#include "holba/base/check.h"
#include "holba/base/temporary_paths.h"
#include "holba/evaluation/pose_auc.h"
#include "holba/io/database.h"
#include "holba/io/model_io.h"

namespace holba {
namespace {

namespace fs = std::filesystem;

struct SfmBenchResult {
  int num_images = 0;
  std::string structure;
  MapOutput map;
  double user_seconds = 0.0;            // of all threads
  size_t registered = 0;                // of the largest model
  std::vector<double> pair_errors_deg;  // against the truth; infinite: not in the model
};

constexpr double kThresholdsDeg[] = {0.5, 1.0, 3.0, 5.0};

double UserSeconds() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_utime.tv_sec) +
         1e-6 * static_cast<double>(usage.ru_utime.tv_usec);
}

void Set(const OptionTable& table, const std::string& name, const std::string& text) {
  const auto& options = table.options();
  const auto found = std::find_if(options.begin(), options.end(),
                                  [&](const Option& option) { return option.name == name; });
  HOLBA_CHECK_MSG(found != options.end(), "an option of map is gone");
  found->SetText(text);
}

// Intrinsics of exact priors are held, as one would.
MapStages StagesOf(const SfmBenchOptions& options, const std::string& structure) {
  MapStages stages;
  OptionTable table;
  table.Bind(&stages);
  Set(table, "Mapper.structure", structure);
  Set(table, "view", "0");
  Set(table, "Solver.num_threads", std::to_string(options.num_threads));
  if (options.photos.focal_length == FocalLengthPrior::kExact) {
    for (const char* name : {"Mapper.ba_refine_focal_length", "Mapper.ba_refine_extra_params",
                             "Bundle.refine_focal_length", "Bundle.refine_extra_params",
                             "Bundle.refine_principal_point"})
      Set(table, name, "0");
  }
  return stages;
}

std::vector<SfmBenchResult> MapAll(const SfmBenchOptions& options) {
  const TemporaryPath folder(fs::temp_directory_path() / fmt::format("holba-sfm-{}", getpid()));
  std::vector<SfmBenchResult> results;
  for (const int& num_images : options.num_images) {
    PhotoSetOptions photos = options.photos;
    photos.num_images = num_images;
    const PhotoSet set = MakePhotoSet(photos);
    const fs::path database_path = folder.path() / fmt::format("{}.db", num_images);
    {
      Database database(database_path);
      WritePhotoDatabase(set, GeometrySource::kTruth, options.num_threads, &database);
    }
    for (const std::string& structure : options.structures) {
      SfmBenchResult& result = results.emplace_back();
      result.num_images = num_images;
      result.structure = structure;
      MapStages stages = StagesOf(options, structure);
      const fs::path output = folder.path() / fmt::format("{}-{}", num_images, structure);
      const double begin = UserSeconds();
      result.map = stages.Run({.database_path = database_path.string(),
                               .image_path = "",
                               .input_path = "",
                               .output_path = output.string()});
      result.user_seconds = UserSeconds() - begin;
      // The first model is the one with the most images.
      const PoseErrors errors = ComparePoses(ReadPoses(output / "0"), set.truth, {});
      result.registered = errors.registered;
      result.pair_errors_deg = errors.pair_deg;
      const bool is_last =
          &structure == &options.structures.back() && &num_images == &options.num_images.back();
      if (is_last && !options.page_path.empty())
        WritePageBesideTruth(ReadModel(output / "0"), set.truth, options.page_path);
    }
  }
  return results;
}

std::vector<Table> SfmTables(const std::vector<SfmBenchResult>& results) {
  Table runtime, reconstruction;
  runtime.title =
      "Runtime of the first model; ms per iteration of the first and of later iterations:";
  runtime.header = {"structure", "images", "user s", "wall s",     "local",     "iterations",
                    "ms, first", "later",  "global", "iterations", "ms, first", "later"};
  reconstruction.title = "Reconstruction; pose AUC in percent:";
  reconstruction.header = {"structure",    "images", "registered", "models",   "points",
                           "observations", "lines",  "groups",     "error px", "@0.5",
                           "@1",           "@3",     "@5"};
  for (const SfmBenchResult& result : results) {
    const MapOutput::OfModel& model = result.map.models.front();
    std::vector<std::string> row = {result.structure, std::to_string(result.num_images),
                                    fmt::format("{:.1f}", result.user_seconds),
                                    fmt::format("{:.1f}", result.map.total_seconds)};
    for (const AdjustmentCounts* counts :
         {&model.map.adjustments.local, &model.map.adjustments.global}) {
      const double num = static_cast<double>(std::max<size_t>(1, counts->num_adjustments));
      const double later = static_cast<double>(counts->num_iterations) -
                           static_cast<double>(counts->num_adjustments);
      row.push_back(std::to_string(counts->num_adjustments));
      row.push_back(fmt::format("{:.1f}", static_cast<double>(counts->num_iterations) / num));
      row.push_back(ThreeDigits(1e3 * counts->first_iteration_seconds / num));
      row.push_back(ThreeDigits(1e3 * counts->later_iteration_seconds / std::max(1.0, later)));
    }
    runtime.rows.push_back(std::move(row));
    row = {result.structure,
           std::to_string(result.num_images),
           std::to_string(result.registered),
           std::to_string(result.map.models.size()),
           std::to_string(model.num_points),
           std::to_string(model.num_observations),
           std::to_string(model.num_lines),
           std::to_string(model.num_groups),
           fmt::format("{:.3f}", model.mean_error_px)};
    for (const double threshold_deg : kThresholdsDeg) {
      row.push_back(fmt::format(
          "{:.1f}", 100.0 * PoseAuc(result.pair_errors_deg, threshold_deg, AucConvention::kStep)));
    }
    reconstruction.rows.push_back(std::move(row));
  }
  return {runtime, reconstruction};
}

nlohmann::json SfmBenchToJson(const std::vector<SfmBenchResult>& results) {
  nlohmann::json list = nlohmann::json::array();
  for (const SfmBenchResult& result : results) {
    nlohmann::json auc;
    for (const double threshold_deg : kThresholdsDeg) {
      auc[fmt::format("{:g}", threshold_deg)] =
          100.0 * PoseAuc(result.pair_errors_deg, threshold_deg, AucConvention::kStep);
    }
    list.push_back({{"images", result.num_images},
                    {"structure", result.structure},
                    {"user_seconds", result.user_seconds},
                    {"registered", result.registered},
                    {"auc", std::move(auc)},
                    {"map", MapToJson(result.map)}});
  }
  return list;
}

}  // namespace

SfmBenchReport BenchSfm(const SfmBenchOptions& options) {
  const std::vector<SfmBenchResult> results = MapAll(options);
  return {SfmTables(results), SfmBenchToJson(results)};
}

}  // namespace holba
