// SPDX-License-Identifier: BSD-3-Clause
#include <cmath>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "apps/bench/plot.h"
#include "apps/bench/rendered_bench.h"
#include "apps/bench/rendered_set.h"
#include "holba/base/log.h"
#include "holba/evaluation/primitive_errors.h"
#include "holba/evaluation/statistics.h"

namespace holba {
namespace {

// Types of the label maps of the preset `table`.
const std::vector<std::string> kTypes = {"PLANE", "SPHERE",    "CYLINDER",
                                         "CONE",  "ELLIPSOID", "CUBOID"};
constexpr double kMillimetres = 1000.0;

// Figures of one type in one scene.
struct TypeFigures {
  double num_true = 0, num_found = 0, num_extra = 0;
  std::vector<double> radius_percent, angle_deg, offset_mm;
};

double MedianOrNone(const std::vector<double>& values) {
  const auto stats = Summarise(values);
  return stats ? stats->median : NAN;
}

std::map<std::string, TypeFigures> FiguresOf(const Reconstruction& model,
                                             const Reconstruction& truth) {
  std::map<std::string, TypeFigures> figures;
  const PrimitiveErrors errors = MeasurePrimitives(model, truth, Sim3d(), {});
  for (const PrimitivePair& pair : errors.pairs) {
    TypeFigures& of_type = figures[std::string(pair.type->name)];
    ++of_type.num_true;
    ++of_type.num_found;
    if (pair.radius_percent) of_type.radius_percent.push_back(*pair.radius_percent);
    for (const auto& [name, error] : pair.errors) {
      if (name == "normal_deg" || name == "axis_deg" || name == "axes_deg" ||
          name == "direction_deg")
        of_type.angle_deg.push_back(error);
      if (name == "offset" || name == "centre" || name == "axis_offset" || name == "apex")
        of_type.offset_mm.push_back(kMillimetres * error);
    }
  }
  for (const group3D_t id : errors.missed)
    ++figures[std::string(truth.groups3D.at(id).type->name)].num_true;
  for (const group3D_t id : errors.extra)
    ++figures[std::string(model.groups3D.at(id).type->name)].num_extra;
  return figures;
}

}  // namespace

PaperBenchReport BenchPrimitives(const PaperBenchOptions& options) {
  const RenderedSets sets(options);
  SeedTable table("primitives",
                  "Primitives of label maps on a table, cameras held at the truth; errors are "
                  "medians over the objects of a scene:",
                  kTypes, options.SeedNames(),
                  // Rows are things of different kinds, which are not to be compared.
                  {{"true", BetterIs::kNeither, 1},
                   {"found", BetterIs::kNeither, 1},
                   {"of none", BetterIs::kNeither, 1},
                   {"radius, %", BetterIs::kNeither, 2},
                   {"angle, deg", BetterIs::kNeither, 3},
                   {"place, mm", BetterIs::kNeither, 2}});
  for (size_t c = 0; c < table.cases.size(); ++c) {
    const RenderedSet set = sets.Table(static_cast<int>(c));
    const Reconstruction model =
        RefineOnSet(set, TriangulateOnTruth(set),
                    {{"Import.labels_path", set.Labels().string()}, {"Refine.fix_poses", "1"}});
    std::map<std::string, TypeFigures> figures = FiguresOf(model, set.truth);
    for (size_t r = 0; r < kTypes.size(); ++r) {
      const TypeFigures& of_type = figures[kTypes[r]];
      table.Set(
          r, c,
          std::vector<double>{of_type.num_true, of_type.num_found, of_type.num_extra,
                              MedianOrNone(of_type.radius_percent), MedianOrNone(of_type.angle_deg),
                              MedianOrNone(of_type.offset_mm)});
    }
    LogInfo("Table {}: {} groups of the model", table.cases[c], model.groups3D.size());
  }
  PaperBenchReport report;
  report.plot = DotPlot(table);
  report.tables = {std::move(table)};
  return report;
}

}  // namespace holba
