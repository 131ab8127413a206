// SPDX-License-Identifier: BSD-3-Clause
#include "holba/sfm/extend_structure.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "holba/geometry/angle.h"
#include "holba/group/known_types.h"

namespace holba {

size_t LabelNewLines(const StructureOptions& options, std::span<const line3D_t> line_ids,
                     MapperState* state) {
  size_t num_joined = 0;
  Reconstruction& model = *state->mutable_model();
  std::vector<group3D_t> vps;
  for (const auto& [id, group] : model.groups3D) {
    if (IsVanishingPoint(*group.type)) vps.push_back(id);
  }
  // Of a line, by how far its direction may be off where the segments' vanishing points agree with
  // the group's: as far as vanishing points of images agree in the median.
  const double min_cos = std::cos(DegToRad(options.vps.max_median_deviation_deg));
  for (const line3D_t id : line_ids) {
    const Line3D* line = model.lines3D.Find(id);
    if (line == nullptr || !model.GroupsOfLine(id).empty()) continue;
    group3D_t best = kNoId;
    double best_cos = min_cos;
    for (const group3D_t vp : vps) {
      const Eigen::Map<const Eigen::Vector3d> direction(model.groups3D.at(vp).params.data());
      const double cosine = std::abs(direction.normalized().dot(line->line.direction.normalized()));
      if (cosine > best_cos) {
        best_cos = cosine;
        best = vp;
      }
    }
    if (best == kNoId) continue;
    // Most of its segments run to an image's vanishing point in that direction.
    const Eigen::Map<const Eigen::Vector3d> direction(model.groups3D.at(best).params.data());
    size_t num_agreeing = 0;
    for (const LineObservation& observation : line->track) {
      const auto features = state->input().features.find(observation.image_id);
      if (features == state->input().features.end()) continue;
      const ImageFeatures& of_image = features->second;
      if (observation.line2D_idx >= of_image.vp_of_segment.size()) continue;
      const int32_t vp_idx = of_image.vp_of_segment[observation.line2D_idx];
      if (vp_idx < 0) continue;
      const Eigen::Vector3d in_world =
          model.images.at(observation.image_id).cam_from_world.rotation.conjugate() *
          of_image.vanishing_points[vp_idx].direction_in_cam;
      const double max_deviation = std::cos(DegToRad(options.vps.max_deviation_deg));
      num_agreeing += std::abs(in_world.normalized().dot(direction.normalized())) > max_deviation;
    }
    if (2 * num_agreeing <= line->track.size()) continue;
    num_joined += model.AddLineMember(best, id);
  }
  return num_joined;
}

void RebuildGroups(const MapperOptions& options, MapperState* state) {
  if (options.structure < MapperStructure::kGroups) return;
  Reconstruction& model = *state->mutable_model();
  const StructureOptions& structure = options.structure_options;
  model.relations.clear();
  // Planes stay, with the members that still fit: only points on none of them are searched for
  // more, or the search would cost the square of the model.
  model.DeleteGroups3D([](group3D_t, const Group3D& group) { return !IsPlane(*group.type); });
  UpdateMembers(structure.regions.members, &model);
  FormVanishingPoints(structure.vps, state->input().features, &model);
  LabelLines(structure.line_labels, &model);
  DetectPlanes(structure.planes, &model);
  AddLinesToPlanes(structure.plane_members, &model);
  AddPointsToPlanes(structure.plane_members, {}, &model);
  UpdateMembers(structure.regions.members, &model);
  if (options.structure == MapperStructure::kHolistic) FormWireframe(structure.wireframe, &model);
  if (structure.form_relations) FormRelations(structure.relations, &model);
}

}  // namespace holba
