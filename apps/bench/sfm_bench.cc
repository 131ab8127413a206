// SPDX-License-Identifier: BSD-3-Clause
#include "apps/bench/sfm_bench.h"

#include <fmt/format.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <limits>
#include <utility>

#include "apps/bench/option_texts.h"
#include "apps/bench/plot.h"
#include "apps/map/map_stages.h"
#include "apps/map/report.h"
#include "apps/synthesize/photo_database.h"
#include "apps/view/page_beside_truth.h"
#include "holba/base/temporary_paths.h"
#include "holba/evaluation/pose_auc.h"
#include "holba/io/database.h"
#include "holba/io/model_io.h"

namespace holba {
namespace {

namespace fs = std::filesystem;

struct SfmBenchResult {
  MapOutput map;
  double user_seconds = 0.0;  // of all threads
  size_t registered = 0;      // of the largest model
  std::vector<double> aucs;   // percent, against the truth
};

const std::vector<double> kThresholdsDeg = {0.5, 1, 3, 5};

double UserSeconds() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_utime.tv_sec) +
         1e-6 * static_cast<double>(usage.ru_utime.tv_usec);
}

// Intrinsics of exact priors are held, as one would.
MapStages StagesOf(const SfmBenchOptions& options, const std::string& structure) {
  OptionTexts texts = {{"Mapper.structure", structure},
                       {"Solver.num_threads", std::to_string(options.bench.num_threads)},
                       {"view", "0"}};
  if (options.photos.focal_length == FocalLengthPrior::kExact) {
    for (const char* name : {"Mapper.ba_refine_focal_length", "Mapper.ba_refine_extra_params",
                             "Bundle.refine_focal_length", "Bundle.refine_extra_params",
                             "Bundle.refine_principal_point"})
      texts.emplace_back(name, "0");
  }
  MapStages stages;
  SetOptions(texts, &stages);
  return stages;
}

std::vector<int> SizesOf(const SfmBenchOptions& options) {
  if (!options.bench.num_images.empty()) return options.bench.num_images;
  return {options.bench.NumImages(60, 60, 1000)};
}

// "lines", or, of several sizes, "lines, 100 images".
std::vector<std::string> RowsOf(const SfmBenchOptions& options) {
  const std::vector<int> sizes = SizesOf(options);
  std::vector<std::string> rows;
  for (const int size : sizes) {
    for (const std::string& structure : options.structures)
      rows.push_back(sizes.size() == 1 ? structure : fmt::format("{}, {} images", structure, size));
  }
  return rows;
}

// [seed][row]
std::vector<std::vector<SfmBenchResult>> MapAll(const SfmBenchOptions& options) {
  const TemporaryPath folder(fs::temp_directory_path() / fmt::format("holba-sfm-{}", getpid()));
  std::vector<std::vector<SfmBenchResult>> results(options.bench.NumSeeds());
  for (size_t s = 0; s < results.size(); ++s) {
    for (const int num_images : SizesOf(options)) {
      PhotoSetOptions photos = options.photos;
      photos.num_images = num_images;
      photos.seed = options.bench.seed + s;
      const PhotoSet set = MakePhotoSet(photos);
      const fs::path database_path = folder.path() / fmt::format("{}-{}.db", s, num_images);
      {
        Database database(database_path);
        WritePhotoDatabase(set, GeometrySource::kTruth, options.bench.num_threads, &database);
      }
      for (const std::string& structure : options.structures) {
        SfmBenchResult& result = results[s].emplace_back();
        MapStages stages = StagesOf(options, structure);
        const fs::path output = folder.path() / fmt::format("{}-{}-{}", s, num_images, structure);
        const double begin = UserSeconds();
        result.map = stages.Run({.database_path = database_path.string(),
                                 .image_path = "",
                                 .input_path = "",
                                 .output_path = output.string()});
        result.user_seconds = UserSeconds() - begin;
        // The first model is the one with the most images.
        const PoseErrors errors = ComparePoses(ReadPoses(output / "0"), set.truth);
        result.registered = errors.registered;
        for (const double threshold_deg : kThresholdsDeg)
          result.aucs.push_back(100.0 * PoseAuc(errors.pair_deg, threshold_deg));
        const bool is_last = s + 1 == results.size() && num_images == SizesOf(options).back() &&
                             &structure == &options.structures.back();
        if (is_last && !options.page_path.empty())
          WritePageBesideTruth(ReadModel(output / "0"), set.truth, options.page_path);
      }
    }
  }
  return results;
}

// Of one iteration; not a number where there was none.
double MillisecondsEach(double seconds, size_t num_iterations) {
  return num_iterations == 0 ? std::numeric_limits<double>::quiet_NaN()
                             : 1e3 * seconds / static_cast<double>(num_iterations);
}
double FirstMilliseconds(const AdjustmentCounts& counts) {
  return MillisecondsEach(counts.first_iteration_seconds, counts.num_adjustments);
}
double LaterMilliseconds(const AdjustmentCounts& counts) {
  return MillisecondsEach(
      counts.later_iteration_seconds,
      counts.num_iterations - std::min(counts.num_iterations, counts.num_adjustments));
}
const AdjustmentReport& AdjustmentsOf(const SfmBenchResult& result) {
  return result.map.models.front().map.adjustments;
}

// `first`: with the first structure, of the same database.
std::vector<double> RuntimeOf(const SfmBenchResult& result, const SfmBenchResult& first) {
  std::vector<double> values = {result.user_seconds, result.user_seconds / first.user_seconds,
                                result.map.total_seconds};
  for (const AdjustmentCounts* counts :
       {&AdjustmentsOf(result).local, &AdjustmentsOf(result).global}) {
    const double num_adjustments = static_cast<double>(counts->num_adjustments);
    values.push_back(num_adjustments);
    values.push_back(static_cast<double>(counts->num_iterations) / std::max(1.0, num_adjustments));
    values.push_back(MillisecondsEach(
        counts->first_iteration_seconds + counts->later_iteration_seconds, counts->num_iterations));
  }
  return values;
}

std::vector<double> ReconstructionOf(const SfmBenchResult& result, const SfmBenchResult&) {
  const MapOutput::OfModel& model = result.map.models.front();
  std::vector<double> values = {static_cast<double>(result.registered),
                                static_cast<double>(result.map.models.size()),
                                static_cast<double>(model.num_points),
                                static_cast<double>(model.num_observations),
                                static_cast<double>(model.num_lines),
                                static_cast<double>(model.num_groups),
                                model.mean_error_px};
  values.insert(values.end(), result.aucs.begin(), result.aucs.end());
  return values;
}

std::vector<double> BreakdownOf(const SfmBenchResult& result, const SfmBenchResult&) {
  std::vector<double> values;
  for (const AdjustmentCounts* counts :
       {&AdjustmentsOf(result).local, &AdjustmentsOf(result).global}) {
    const double first = FirstMilliseconds(*counts), later = LaterMilliseconds(*counts);
    values.insert(values.end(), {first, later, first / later});
  }
  return values;
}

SeedTable TableOfRuns(const SfmBenchOptions& options,
                      const std::vector<std::vector<SfmBenchResult>>& results, std::string name,
                      std::string title, std::vector<SeedMeasure> measures,
                      std::vector<double> (*values_of)(const SfmBenchResult&,
                                                       const SfmBenchResult& first)) {
  SeedTable table(std::move(name), std::move(title), RowsOf(options), options.bench.SeedNames(),
                  std::move(measures));
  for (size_t s = 0; s < results.size(); ++s) {
    for (size_t r = 0; r < results[s].size(); ++r) {
      const size_t first = r - r % options.structures.size();
      table.Set(r, s, values_of(results[s][r], results[s][first]));
    }
  }
  return table;
}

}  // namespace

PaperBenchReport BenchSfm(const SfmBenchOptions& options) {
  const auto results = MapAll(options);
  std::vector<SeedMeasure> reconstruction = {
      {"registered", BetterIs::kHigher, 1}, {"models", BetterIs::kLower, 1},
      {"points", BetterIs::kNeither, 0},    {"observations", BetterIs::kNeither, 0},
      {"lines", BetterIs::kNeither, 0},     {"groups", BetterIs::kNeither, 0},
      {"error, px", BetterIs::kLower, 3}};
  for (const double threshold_deg : kThresholdsDeg)
    reconstruction.push_back({fmt::format("AUC @{:g} deg", threshold_deg), BetterIs::kHigher, 1});
  PaperBenchReport report;
  report.tables = {
      TableOfRuns(options, results, "sfm_runtime",
                  "Runtime of the first model, with its refinement:",
                  {{"user s", BetterIs::kLower, 1},
                   {"time ratio", BetterIs::kLower, 2},
                   {"wall s", BetterIs::kLower, 1},
                   {"local", BetterIs::kNeither, 0},
                   {"local: iterations", BetterIs::kNeither, 1},
                   {"local: ms each", BetterIs::kLower, 2},
                   {"global", BetterIs::kNeither, 0},
                   {"global: iterations", BetterIs::kNeither, 1},
                   {"global: ms each", BetterIs::kLower, 2}},
                  RuntimeOf),
      TableOfRuns(options, results, "sfm", "Reconstruction; pose AUC in percent against the truth:",
                  std::move(reconstruction), ReconstructionOf)};
  report.plot = DotPlot(report.tables[1]);
  return report;
}

PaperBenchReport BenchBreakdown(const SfmBenchOptions& options) {
  PaperBenchReport report;
  report.tables = {TableOfRuns(options, MapAll(options), "breakdown",
                               "Milliseconds of the first iteration of an adjustment, with the "
                               "analysis of the problem, and "
                               "of a later one:",
                               {{"local: first", BetterIs::kNeither, 2},
                                {"local: later", BetterIs::kNeither, 2},
                                {"local: ratio", BetterIs::kNeither, 2},
                                {"global: first", BetterIs::kNeither, 2},
                                {"global: later", BetterIs::kNeither, 2},
                                {"global: ratio", BetterIs::kNeither, 2}},
                               BreakdownOf)};
  report.plot = DotPlot(report.tables[0]);
  return report;
}

}  // namespace holba
