// SPDX-License-Identifier: BSD-3-Clause
#include "holba/sfm/structure.h"

#include <algorithm>
#include <set>
#include <vector>

#include "holba/base/timer.h"
#include "holba/group/known_types.h"

namespace holba {
namespace {

std::vector<point3D_t> JunctionIds(const JunctionReport& report) {
  std::vector<point3D_t> ids;
  for (const Junction& junction : report.junctions) ids.push_back(junction.point3D_id);
  return ids;
}

// A curved surface that is known by its label has been cut into planes before: those of most of
// whose points it explains are not there.
size_t RemovePlanesOnCurvedRegions(Reconstruction* model) {
  std::set<point3D_t> curved;
  for (const auto& [id, group] : model->groups3D) {
    if (group.type->TakesPoints() && !group.type->TakesLines())
      curved.insert(group.point3D_ids.begin(), group.point3D_ids.end());
  }
  std::set<group3D_t> planes;
  for (const auto& [id, group] : model->groups3D) {
    if (!IsPlane(*group.type)) continue;
    const auto count = std::count_if(group.point3D_ids.begin(), group.point3D_ids.end(),
                                     [&](point3D_t p) { return curved.contains(p); });
    if (2 * static_cast<size_t>(count) > group.point3D_ids.size()) planes.insert(id);
  }
  model->DeleteGroups3D([&](group3D_t id, const Group3D&) { return planes.contains(id); });
  return planes.size();
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

void StructureOptions::SetNumThreads(int num_threads) {
  planes.num_threads = plane_members.num_threads = regions.members.num_threads = num_threads;
}

void StructureOptions::Describe(OptionTable* table) const {
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
  // Once more, with the points that came since: those that the known planes do not explain.
  AddPointsToPlanes(options.plane_members, {}, model);
  report.small_planes = DetectPlanes(options.planes, model);
  lap("planes");
  if (observe_regions) {
    const RegionObservations regions = observe_regions(model);
    report.regions = FormGroups(options.regions, regions.matches, regions.normals, model);
    report.regions.dropped["plane: piece of a labelled curved surface"] +=
        RemovePlanesOnCurvedRegions(model);
    lap("regions");
  }
  UpdateAssociations(options, model, &report);
  return report;
}

}  // namespace holba
