// SPDX-License-Identifier: BSD-3-Clause
#include "apps/bench/accuracy.h"

#include <fmt/format.h>

#include <optional>

#include "apps/bench/timing.h"
#include "holba/base/check.h"
#include "holba/base/log.h"
#include "holba/bundle/adjust_bundle.h"
#include "holba/evaluation/ground_truth.h"

namespace holba {
namespace {

// Weights of the members of groups and of the wireframe that gain more where associations are
// right.
constexpr double kStrongGroupWeight = 5.0, kStrongWireframeWeight = 1.0;
constexpr size_t kPointRow = 1;

std::string NameOf(Visibility visibility) {
  switch (visibility) {
    case Visibility::kRandom:
      return "random";
    case Visibility::kNear:
      return "near";
    case Visibility::kCluster:
      return "cluster";
  }
  return "";
}

void AddErrors(const Reconstruction& model, const Reconstruction& truth,
               const AccuracyOptions& options, AccuracyRow* row) {
  const std::optional<GroundTruthErrors> errors = CompareToTruth(model, truth, options.alignment);
  HOLBA_CHECK(errors);
  const std::optional<ErrorStats>* const all[] = {
      &errors->rotation_deg,       &errors->position,      &errors->point,
      &errors->line_direction_deg, &errors->line_distance, &errors->plane_normal_deg,
      &errors->plane_offset};
  row->errors.resize(AccuracyMeasures().size());
  for (size_t m = 0; m < row->errors.size(); ++m) {
    HOLBA_CHECK_MSG(*all[m], "a synthetic scene without " + AccuracyMeasures()[m]);
    row->errors[m].push_back(options.median ? (*all[m])->median : (*all[m])->rms);
  }
}

double Mean(const std::vector<double>& values) {
  const auto stats = Summarise(values);
  return stats ? stats->mean : 0.0;
}

std::vector<TimingCase> Methods(const BundleOptions& bundle) {
  std::vector<TimingCase> methods = ConfigCases(bundle);
  TimingCase strong = methods.back();
  strong.name = fmt::format("Holistic, groups {:g}, wireframe {:g}", kStrongGroupWeight,
                            kStrongWireframeWeight);
  strong.bundle[TermFamily::kGroup].weight = kStrongGroupWeight;
  strong.bundle[TermFamily::kWireframe].weight = kStrongWireframeWeight;
  methods.push_back(strong);
  return methods;
}

Table MeanTable(const AccuracyOptions& options, const AccuracyResult& result) {
  Table table = {fmt::format("{} images, {} visibility: {} errors, means over {} seeds",
                             options.scene.num_images, NameOf(result.visibility),
                             options.median ? "median" : "root mean square", options.num_seeds),
                 {"method"},
                 {}};
  for (const std::string& measure : AccuracyMeasures()) table.header.push_back(measure);
  table.header.push_back("iterations");
  for (const AccuracyRow& row : result.rows) {
    std::vector<std::string> cells = {row.method};
    for (const auto& errors : row.errors) cells.push_back(ThreeDigits(Mean(errors)));
    cells.push_back(row.iterations.empty() ? "-" : fmt::format("{:.1f}", Mean(row.iterations)));
    table.rows.push_back(cells);
  }
  return table;
}

Table RatioTable(const AccuracyOptions& options, const AccuracyResult& result) {
  Table table = {
      fmt::format(
          "{} images, {} visibility: ratio to Point on the same seed, geometric mean (worst seed), "
          "seeds better than Point of {}",
          options.scene.num_images, NameOf(result.visibility), options.num_seeds),
      {"method"},
      {}};
  for (const std::string& measure : AccuracyMeasures()) {
    table.header.push_back(measure.substr(0, measure.find(',')));
  }
  for (size_t r = kPointRow + 1; r < result.rows.size(); ++r) {
    const AccuracyRow& row = result.rows[r];
    std::vector<std::string> cells = {row.method};
    for (size_t m = 0; m < row.errors.size(); ++m) {
      const auto ratio = CompareInPairs(row.errors[m], result.rows[kPointRow].errors[m]);
      cells.push_back(ratio ? fmt::format("{:.2f} ({:.2f}), {}", ratio->geometric_mean,
                                          ratio->worst, ratio->wins)
                            : "-");
    }
    table.rows.push_back(cells);
  }
  return table;
}

}  // namespace

const std::vector<std::string>& AccuracyMeasures() {
  static const std::vector<std::string> measures = {
      "rotation, deg", "position",          "point",       "line direction, deg",
      "line distance", "plane normal, deg", "plane offset"};
  return measures;
}

std::vector<AccuracyResult> MeasureAccuracy(const AccuracyOptions& options) {
  std::vector<AccuracyResult> results;
  const std::vector<TimingCase> methods = Methods(options.bundle);
  for (const Visibility visibility : options.visibilities) {
    AccuracyResult result;
    result.visibility = visibility;
    result.rows.push_back({.method = "Start"});
    for (const TimingCase& method : methods) result.rows.push_back({.method = method.name});
    for (int i = 0; i < options.num_seeds; ++i) {
      BundleProblemOptions scene = options.scene;
      scene.visibility = visibility;
      scene.seed += i;
      const SyntheticProblem problem = MakeBundleProblem(scene);
      AddErrors(problem.perturbed, problem.truth, options, &result.rows[0]);
      for (size_t m = 0; m < methods.size(); ++m) {
        AccuracyRow& row = result.rows[m + 1];
        Reconstruction model = problem.perturbed;
        const BundleSummary summary = AdjustBundle(methods[m].bundle, options.solver, &model);
        row.iterations.push_back(summary.solver.iterations);
        row.seconds.push_back(summary.solver.total_seconds);
        AddErrors(model, problem.truth, options, &row);
      }
      LogInfo("{} visibility: seed {} of {}", NameOf(visibility), i + 1, options.num_seeds);
    }
    results.push_back(std::move(result));
  }
  return results;
}

std::vector<Table> AccuracyTables(const AccuracyOptions& options,
                                  const std::vector<AccuracyResult>& results) {
  std::vector<Table> tables;
  for (const AccuracyResult& result : results) {
    tables.push_back(MeanTable(options, result));
    tables.push_back(RatioTable(options, result));
  }
  return tables;
}

nlohmann::json AccuracyToJson(const std::vector<AccuracyResult>& results) {
  nlohmann::json list = nlohmann::json::array();
  for (const AccuracyResult& result : results) {
    nlohmann::json methods = nlohmann::json::array();
    for (const AccuracyRow& row : result.rows) {
      nlohmann::json errors = nlohmann::json::object();
      for (size_t m = 0; m < row.errors.size(); ++m) errors[AccuracyMeasures()[m]] = row.errors[m];
      methods.push_back({{"method", row.method},
                         {"errors_by_seed", errors},
                         {"iterations_by_seed", row.iterations},
                         {"seconds_by_seed", row.seconds}});
    }
    list.push_back({{"visibility", NameOf(result.visibility)}, {"methods", methods}});
  }
  return list;
}

}  // namespace holba
