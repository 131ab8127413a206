// SPDX-License-Identifier: BSD-3-Clause
// 3D structure on given poses: planes among the points, vanishing points over the images, lines
// with the proposals of both, junctions and corners, primitives of labelled regions, the wireframe,
// and the relations between groups.
#pragma once

#include <functional>
#include <map>
#include <string>
#include <vector>

#include "holba/estimation/wireframe/corner_tracks.h"
#include "holba/estimation/groups/group_filter.h"
#include "holba/estimation/groups/group_forming.h"
#include "holba/estimation/wireframe/junctions.h"
#include "holba/estimation/lines/lines_from_segments.h"
#include "holba/estimation/groups/plane_detection.h"
#include "holba/estimation/groups/plane_members.h"
#include "holba/estimation/groups/relations.h"
#include "holba/estimation/directions/vp_lines.h"
#include "holba/estimation/directions/vp_tracks.h"
#include "holba/estimation/wireframe/wireframe.h"
#include "holba/scene/image_features.h"
#include "holba/scene/reconstruction.h"

namespace holba {

struct StructureOptions {
  PlaneOptions planes;
  VpTrackOptions vps;
  LineLabelOptions line_labels;
  LineOptions lines;
  JunctionOptions junctions;
  CornerTrackOptions corners;
  PlaneMemberOptions plane_members;
  GroupFormingOptions regions;  // with the tests of members of all groups
  WireframeOptions wireframe;
  RelationOptions relations;
  bool form_relations = true;

  // For all steps that have threads.
  void SetNumThreads(int num_threads);

  void Describe(OptionTable* table) const;
};

struct StructureReport {
  PlaneReport planes;        // of the points that were there
  PlaneReport small_planes;  // added once junctions and corners were points, too
  VpTrackReport vps;
  LineReport lines;
  LineLabelReport line_labels;
  PlaneMemberReport plane_lines, plane_points;
  MemberReport members;
  JunctionReport junctions;
  CornerTrackReport corners;
  GroupFormingReport regions;
  WireframeReport wireframe;
  RelationReport relations;
  std::map<std::string, double> seconds;  // by step
};

// Empty: there are none. Called once lines, junctions and corners are there.
using RegionObserver = std::function<RegionObservations(Reconstruction*)>;

// The model holds poses and points and no structure.
StructureReport BuildStructure(const StructureOptions& options, const ImageFeatureMap& features,
                               const LineMatchMap* matches, const RegionObserver& observe_regions,
                               int num_threads, Reconstruction* model);

// Members of groups, incidences and relations anew, on the features as they are after an
// adjustment. The parts of `report` that this repeats are replaced.
void UpdateAssociations(const StructureOptions& options, Reconstruction* model,
                        StructureReport* report);

}  // namespace holba
