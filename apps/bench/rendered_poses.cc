// SPDX-License-Identifier: BSD-3-Clause
#include <fmt/format.h>

#include <array>
#include <cmath>
#include <string>
#include <vector>

#include "apps/bench/plot.h"
#include "apps/bench/rendered_bench.h"
#include "apps/bench/rendered_set.h"
#include "holba/base/error.h"
#include "holba/base/log.h"
#include "holba/evaluation/geometry_errors.h"
#include "holba/io/ply_reader.h"

namespace holba {
namespace {

const std::vector<double> kAucThresholdsDeg = {0.5, 1, 3, 5, 10};

// --- Table 4.

struct PoseMapping {
  const char* name;
  const char* structure;  // of --Mapper.structure
  OptionTexts others;
};
const std::vector<PoseMapping>& PoseMappings() {
  static const std::vector<PoseMapping> all = {{"points, as COLMAP", "none", {{"refine", "0"}}},
                                               {"points, refined", "none", {}},
                                               {"Point-Line", "lines", {}},
                                               {"Holistic", "holistic", {}}};
  return all;
}

// What cannot be mapped has no pose.
Reconstruction MapOrNothing(const RenderedSet& set, const PoseMapping& mapping) {
  try {
    return MapSet(set, mapping.structure, mapping.others);
  } catch (const InputError& error) {
    LogWarning("{}: {}", mapping.name, error.what());
    return {};
  }
}

// --- Table 5.

struct Form {
  std::string name;
  OptionTexts options;
};

std::vector<Form> Forms() {
  std::vector<Form> forms = {{"points", {{"Bundle.config", "point"}}}};
  const std::array<std::array<const char*, 2>, 2> gauges = {
      {{"two_cams", "pair fixed"}, {"free", "gauge free"}}};
  for (const auto& [gauge, text] : gauges) {
    for (const char* weight : {"1", "10", "100", "1000"}) {
      forms.push_back({fmt::format("3D, weight {}, {}", weight, text),
                       {{"Bundle.gauge", gauge},
                        {"Bundle.choose_weights", "0"},
                        {"Bundle.group_form", "3d"},
                        {"Bundle.group_3d_weight", weight},
                        {"Bundle.wireframe_form", "3d"},
                        {"Bundle.wireframe_3d_weight", weight}}});
    }
    forms.push_back(
        {fmt::format("2D, {}", text), {{"Bundle.gauge", gauge}, {"Bundle.choose_weights", "0"}}});
  }
  forms.push_back({"2D, weights chosen", {}});
  return forms;
}

// With cameras that are held there is no gauge to fix.
bool IsOfFreeGauge(const Form& form) { return form.name.ends_with("gauge free"); }

}  // namespace

PaperBenchReport BenchPoses(const PaperBenchOptions& options) {
  const RenderedSets sets(options);
  std::vector<std::string> rows;
  for (const PoseMapping& mapping : PoseMappings()) rows.push_back(mapping.name);
  std::vector<SeedMeasure> measures =
      MeasuresAt("AUC", kAucThresholdsDeg, "deg", BetterIs::kHigher);
  measures.push_back({"images", BetterIs::kHigher, 1});
  SeedTable table("poses", "Relative pose AUC in percent, known intrinsics:", rows,
                  sets.RoomNames(), std::move(measures));
  for (size_t c = 0; c < table.cases.size(); ++c) {
    const RenderedSet set = sets.Room(static_cast<int>(c));
    for (size_t r = 0; r < rows.size(); ++r) {
      const Reconstruction model = MapOrNothing(set, PoseMappings()[r]);
      std::vector<double> values = AucsOf(model, set.truth, kAucThresholdsDeg);
      values.push_back(static_cast<double>(model.images.size()));
      table.Set(r, c, values);
      LogInfo("{}, {}: AUC {:.1f} at 1 degree", table.cases[c], rows[r], values[1]);
    }
  }
  PaperBenchReport report;
  report.plot = DotPlot(table);
  report.tables = {std::move(table)};
  return report;
}

PaperBenchReport BenchAblation(const PaperBenchOptions& options) {
  const RenderedSets sets(options);
  const std::vector<Form> forms = Forms();
  std::vector<std::string> rows;
  for (const Form& form : forms) rows.push_back(form.name);
  const std::vector<double> tolerances_cm = {1, 5, 10};
  GeometryOptions geometry;
  geometry.thresholds_mm.clear();
  for (const double tolerance_cm : tolerances_cm)
    geometry.thresholds_mm.push_back(10.0 * tolerance_cm);
  std::vector<SeedMeasure> measures =
      MeasuresAt("accuracy", tolerances_cm, "cm, %", BetterIs::kHigher);
  for (SeedMeasure& measure : measures) measure.digits = 2;
  for (SeedMeasure& measure : MeasuresAt("AUC", kAucThresholdsDeg, "deg", BetterIs::kHigher))
    measures.push_back(std::move(measure));
  SeedTable table(
      "ablation",
      "Accuracy of points (share within the distance of the mesh) with the cameras held "
      "at the truth, and relative pose AUC in percent of cameras that start where points "
      "alone put them:",
      rows, sets.RoomNames(), std::move(measures));
  for (size_t c = 0; c < table.cases.size(); ++c) {
    const RenderedSet set = sets.Room(static_cast<int>(c));
    const Reconstruction at_truth = TriangulateOnTruth(set);
    const Reconstruction mapped = MapOrNothing(set, PoseMappings()[0]);
    const FileGeometry mesh = ReadMesh(set.Mesh());
    const NearestDistance surface = NearestDistance::ToTriangles(mesh.vertices, mesh.triangles);
    for (size_t r = 0; r < forms.size(); ++r) {
      std::vector<double> values(tolerances_cm.size(), NAN);
      if (!IsOfFreeGauge(forms[r])) {
        OptionTexts texts = forms[r].options;
        texts.emplace_back("Refine.fix_poses", "1");
        const GeometryErrors errors = MeasureGeometry(RefineOnSet(set, at_truth, texts), surface,
                                                      geometry, options.num_threads);
        values = SummarisePoints(errors.points, geometry.thresholds_mm).inlier_percent;
      }
      const Reconstruction refined =
          mapped.images.empty() ? Reconstruction() : RefineOnSet(set, mapped, forms[r].options);
      const std::vector<double> aucs = AucsOf(refined, set.truth, kAucThresholdsDeg);
      values.insert(values.end(), aucs.begin(), aucs.end());
      table.Set(r, c, values);
      LogInfo("{}, {}: AUC {:.1f} at 1 degree", table.cases[c], rows[r], aucs[1]);
    }
  }
  PaperBenchReport report;
  report.plot = DotPlot(table);
  report.tables = {std::move(table)};
  return report;
}

}  // namespace holba
