// SPDX-License-Identifier: BSD-3-Clause
#include "apps/bench/local_bench.h"

#include <fmt/format.h>

#include <algorithm>
#include <span>
#include <utility>

#include "apps/bench/solver_problems.h"
#include "holba/base/timer.h"
#include "holba/bundle/adjust_local.h"
#include "holba/evaluation/statistics.h"
#include "holba/synthetic/point_graph.h"

namespace holba {
namespace {

LocalTimes AdjustPart(const LocalBenchOptions& options, std::span<const image_t> image_ids,
                      SolverWorkspace* workspace, Reconstruction* model, double* cost) {
  LocalTimes times;
  const Timer select_timer;
  const BundleSelection selection = BundleSelection::Around(
      *model, options.bundle, image_ids, {.surroundings = false, .hold_cameras = false});
  times.select = select_timer.Seconds();
  const Timer timer;
  const LocalSummary summary =
      AdjustLocal(options.bundle, options.solver, selection, workspace, model);
  const double all = timer.Seconds();
  times.build = summary.build_seconds;
  times.write_back = summary.write_back_seconds;
  times.solve = all - times.build - times.write_back;
  *cost = summary.solver.final_cost;
  return times;
}

LocalBenchResult BenchStreet(const LocalBenchOptions& options, int num_images) {
  PointGraphOptions graph;
  graph.seed = options.seed;
  graph.num_images = num_images;
  graph.observations_per_image = ObservationsPerImage(false, num_images);
  Reconstruction model = MakePointGraph(graph).perturbed;

  const int num_parts = std::min(options.max_parts, num_images / options.part_images);
  std::vector<std::vector<image_t>> parts(num_parts);
  LocalBenchResult result{.num_images = num_images};
  for (int part = 0; part < num_parts; ++part) {
    const size_t begin = static_cast<size_t>(part) * num_images / num_parts;
    for (int k = 0; k < options.part_images; ++k)
      parts[part].push_back((model.images.begin() + begin + k)->first);
  }

  SolverWorkspace in_model_workspace, alone_workspace;
  for (int part = 0; part < num_parts; ++part) {
    // Cut here: parts side by side share points, which the adjustment of the last part has moved.
    Reconstruction copy = CutOut(model, parts[part], model.points3D.size());
    result.num_points += copy.points3D.size();
    double cost = 0.0;
    result.in_model.push_back(
        AdjustPart(options, parts[part], &in_model_workspace, &model, &cost));
    result.in_model_costs.push_back(cost);
    result.alone.push_back(
        AdjustPart(options, parts[part], &alone_workspace, &copy, &cost));
    result.alone_costs.push_back(cost);
  }
  result.num_points /= static_cast<size_t>(num_parts);
  return result;
}

template <typename Step>
double MedianOf(const std::vector<LocalTimes>& times, const Step& step) {
  std::vector<double> seconds;
  for (const LocalTimes& t : times) seconds.push_back(step(t));
  const auto stats = Summarise(seconds);
  return stats ? stats->median : 0.0;
}

struct NamedStep {
  const char* name;
  double (*of)(const LocalTimes&);
};
constexpr NamedStep kSteps[] = {
    {"select", [](const LocalTimes& t) { return t.select; }},
    {"build", [](const LocalTimes& t) { return t.build; }},
    {"solve", [](const LocalTimes& t) { return t.solve; }},
    {"write back", [](const LocalTimes& t) { return t.write_back; }},
    {"set-up: select and build", [](const LocalTimes& t) { return t.SetUp(); }},
    {"build, solve and write back", [](const LocalTimes& t) { return t.Adjustment(); }}};

}  // namespace

std::vector<LocalBenchResult> BenchLocal(const LocalBenchOptions& given) {
  LocalBenchOptions options = given;
  options.bundle.config = BundleConfig::kPoint;
  std::vector<LocalBenchResult> results;
  for (const int num_images : options.num_images)
    results.push_back(BenchStreet(options, num_images));
  return results;
}

std::vector<Table> LocalTables(const LocalBenchOptions& options,
                               const std::vector<LocalBenchResult>& results) {
  std::vector<Table> tables;
  for (const LocalBenchResult& result : results) {
    size_t num_equal = 0;
    for (size_t k = 0; k < result.alone_costs.size(); ++k)
      num_equal += result.alone_costs[k] == result.in_model_costs[k];
    Table& table = tables.emplace_back();
    table.title = fmt::format(
        "{} images in a row with {} points, alone and in a street of {} images; milliseconds, "
        "medians over {} parts, of which {} end at the same cost to the last bit:",
        options.part_images, result.num_points, result.num_images, result.alone.size(), num_equal);
    table.header = {"step", "alone", "in the model", "ratio"};
    for (const NamedStep& step : kSteps) {
      const double alone = MedianOf(result.alone, step.of);
      const double in_model = MedianOf(result.in_model, step.of);
      table.rows.push_back({step.name, ThreeDigits(1e3 * alone), ThreeDigits(1e3 * in_model),
                            fmt::format("{:.2f}", in_model / alone)});
    }
  }
  return tables;
}

nlohmann::json LocalBenchToJson(const std::vector<LocalBenchResult>& results) {
  nlohmann::json list = nlohmann::json::array();
  for (const LocalBenchResult& result : results) {
    nlohmann::json medians;
    for (const NamedStep& step : kSteps) {
      medians[step.name] = {{"alone_seconds", MedianOf(result.alone, step.of)},
                            {"in_model_seconds", MedianOf(result.in_model, step.of)}};
    }
    list.push_back({{"images", result.num_images},
                    {"parts", result.alone.size()},
                    {"points", result.num_points},
                    {"medians", medians}});
  }
  return list;
}

}  // namespace holba
