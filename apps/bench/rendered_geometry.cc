// SPDX-License-Identifier: BSD-3-Clause
#include <cmath>
#include <utility>
#include <vector>

#include "apps/bench/plot.h"
#include "apps/bench/rendered_bench.h"
#include "apps/bench/rendered_set.h"
#include "holba/base/log.h"
#include "holba/evaluation/geometry_errors.h"
#include "holba/evaluation/multi_view.h"
#include "holba/io/ply_reader.h"

namespace holba {
namespace {

// Groups also propose lines and enter their first fit: without them altogether these are off, too.
struct Constraints {
  const char* name;
  OptionTexts options;
};
const std::vector<Constraints>& AllConstraints() {
  static const std::vector<Constraints> all = {
      {"each point and line by itself",
       {{"Bundle.config", "point_line"},
        {"Lines.propose_from_groups", "0"},
        {"Lines.vp_weight_px_per_rad", "0"},
        {"Lines.plane_weight", "0"}}},
      {"groups", {{"Bundle.config", "groups"}}},
      {"groups and wireframe", {{"Bundle.config", "holistic"}}}};
  return all;
}

template <typename Figures>
void Append(const Figures& figures, std::vector<double>* values) {
  values->insert(values->end(), figures.begin(), figures.end());
}

}  // namespace

PaperBenchReport BenchGeometry(const PaperBenchOptions& options) {
  const RenderedSets sets(options);
  GeometryOptions geometry;
  geometry.min_line_images = geometry.limap_min_line_images;
  const MultiViewOptions multi_view;

  std::vector<std::string> rows;
  for (const Constraints& constraints : AllConstraints()) rows.push_back(constraints.name);
  std::vector<SeedMeasure> points = {{"points", BetterIs::kNeither, 0}};
  for (SeedMeasure& measure :
       MeasuresAt("within", geometry.thresholds_mm, "mm, %", BetterIs::kHigher))
    points.push_back(std::move(measure));
  points.push_back({"median, mm", BetterIs::kLower, 2});
  std::vector<SeedMeasure> lines = {{"lines", BetterIs::kNeither, 0}};
  for (SeedMeasure& measure :
       MeasuresAt("recall", geometry.thresholds_mm, "mm, m", BetterIs::kHigher))
    lines.push_back(std::move(measure));
  for (SeedMeasure& measure :
       MeasuresAt("precision", geometry.thresholds_mm, "mm, %", BetterIs::kHigher))
    lines.push_back(std::move(measure));
  std::vector<SeedMeasure> cloud;
  for (const char* name : {"accuracy", "completeness", "F1"}) {
    for (SeedMeasure& measure :
         MeasuresAt(name, multi_view.tolerances_cm, "cm, %", BetterIs::kHigher)) {
      measure.digits = 2;
      cloud.push_back(std::move(measure));
    }
  }
  const std::vector<std::string> cases = sets.RoomNames();
  PaperBenchReport report;
  report.tables = {
      SeedTable("geometry_points", "Points against the mesh, cameras held at the truth:", rows,
                cases, std::move(points)),
      SeedTable("geometry_lines",
                "Lines in 4 or more images against the mesh (recall: length within the distance, "
                "precision: its share of all length):",
                rows, cases, std::move(lines)),
      SeedTable("geometry_multi_view",
                "Points against a scan of the whole surface, by ETH3D's protocol:", rows, cases,
                std::move(cloud))};

  for (size_t c = 0; c < cases.size(); ++c) {
    const RenderedSet set = sets.Room(static_cast<int>(c));
    const Reconstruction posed = TriangulateOnTruth(set);
    const FileGeometry mesh = ReadMesh(set.Mesh());
    const NearestDistance surface = NearestDistance::ToTriangles(mesh.vertices, mesh.triangles);
    const std::vector<Eigen::Vector3d> scan = ScanOfMesh(set.Mesh(), multi_view.voxel_size_m);
    const std::vector<TruthScan> scans = {{scan, Rigid3d(), false}};
    for (size_t r = 0; r < AllConstraints().size(); ++r) {
      OptionTexts texts = AllConstraints()[r].options;
      texts.emplace_back("Refine.fix_poses", "1");
      const Reconstruction model = RefineOnSet(set, posed, texts);
      const GeometryErrors errors = MeasureGeometry(model, surface, geometry, options.num_threads);
      const PointSummary of_points = SummarisePoints(errors.points, geometry.thresholds_mm);
      std::vector<double> values = {static_cast<double>(of_points.count)};
      Append(of_points.inlier_percent, &values);
      values.push_back(of_points.median_mm.value_or(NAN));
      report.tables[0].Set(r, c, values);

      const LineSummary of_lines =
          SummariseLinesAsPaper(errors.lines, geometry.thresholds_mm.size());
      values = {static_cast<double>(of_lines.count)};
      Append(of_lines.recall_m, &values);
      Append(of_lines.precision_percent, &values);
      report.tables[1].Set(r, c, values);

      std::vector<Eigen::Vector3d> positions;
      for (const auto& [id, point] : model.points3D) positions.push_back(point.xyz);
      const MultiViewErrors of_cloud =
          MeasureMultiView(positions, scans, multi_view, options.num_threads);
      values = {};
      Append(of_cloud.accuracy_percent, &values);
      Append(of_cloud.completeness_percent, &values);
      Append(of_cloud.f1_percent, &values);
      report.tables[2].Set(r, c, values);
      LogInfo("{}, {}: {:.1f} % of the points within {:g} mm", cases[c], rows[r],
              of_points.inlier_percent[0], geometry.thresholds_mm[0]);
    }
  }
  report.plot = DotPlot(report.tables[0]);
  return report;
}

}  // namespace holba
