// SPDX-License-Identifier: BSD-3-Clause
#include "holba/sfm/structure.h"

#include <vector>

#include "holba/base/timer.h"

namespace holba {
namespace {

std::vector<point3D_t> JunctionIds(const JunctionReport& report) {
  std::vector<point3D_t> ids;
  for (const Junction& junction : report.junctions) ids.push_back(junction.point3D_id);
  return ids;
}

}  // namespace

void UpdateAssociations(const StructureOptions& options, Reconstruction* model,
                        StructureReport* report) {
  Timer timer;
  report->line_labels = LabelLines(options.line_labels, model);
  report->plane_lines = AddLinesToPlanes(options.plane_members, model);
  report->plane_points = AddPointsToPlanes(options.plane_members, {}, model);
  report->members = UpdateMembers(options.regions.members, model);
  report->seconds["associate groups"] += timer.Seconds();
  timer = Timer();
  report->wireframe = FormWireframe(options.wireframe, model);
  report->seconds["wireframe"] += timer.Seconds();
  timer = Timer();
  if (options.form_relations) {
    model->relations.clear();
    report->relations = FormRelations(options.relations, model);
  }
  report->seconds["relations"] += timer.Seconds();
}

void StructureOptions::Describe(OptionTable* table) {
  planes.Describe(table);
  vps.Describe(table);
  lines.Describe(table);
  line_labels.Describe(table);
  plane_members.Describe(table);
  regions.Describe(table);
  junctions.Describe(table);
  corners.Describe(table);
  wireframe.Describe(table);
  relations.Describe(table);
  table->Section("Relations");
  table->Field("form", &form_relations,
               "Whether groups that are nearly orthogonal or parallel become so.");
}

StructureReport BuildStructure(const StructureOptions& options, const ImageFeatureMap& features,
                               const LineMatchMap* matches, const RegionObserver& observe_regions,
                               int num_threads, Reconstruction* model) {
  StructureReport report;
  Timer timer;
  const auto lap = [&](const char* step) {
    report.seconds[step] += timer.Seconds();
    timer = Timer();
  };
  report.vps = FormVanishingPoints(options.vps, features, model);
  lap("vanishing points");
  report.planes = DetectPlanes(options.planes, model);
  lap("planes");
  report.lines = BuildLines(options.lines, features, matches, num_threads, model);
  lap("lines");
  report.junctions = TriangulateJunctions(options.junctions, num_threads, model);
  lap("junctions");
  const std::vector<point3D_t> junction_ids = JunctionIds(report.junctions);
  report.corners = TriangulateCorners(options.corners, features, num_threads, model, junction_ids);
  lap("corners");
  // Once more, with the points that came since among those that are on no plane yet.
  report.small_planes = DetectPlanes(options.planes, model);
  lap("planes");
  if (observe_regions) {
    const RegionObservations regions = observe_regions(model);
    report.regions = FormGroups(options.regions, regions.matches, regions.normals, model);
    lap("regions");
  }
  UpdateAssociations(options, model, &report);
  return report;
}

}  // namespace holba
