// SPDX-License-Identifier: BSD-3-Clause
// Blocks of groups, and the residuals of their members, relations and measurements.
#include <cmath>

#include "holba/base/check.h"
#include "holba/bundle/problem_builder.h"
#include "holba/geometry/angle.h"
#include "holba/residual/group_line.h"
#include "holba/residual/group_line_3d.h"
#include "holba/residual/group_measurement.h"
#include "holba/residual/group_point.h"
#include "holba/residual/group_point_3d.h"
#include "holba/residual/relation.h"
#include "holba/residual/vanishing_point.h"

namespace holba {

void ProblemBuilder::AddGroups() {
  group_idx_ = FlatIndex(selection_.groups.size());
  for (const SelectedGroup& selected : selection_.groups) {
    const Group3D& group = model_.groups3D.at(selected.id);
    double values[kMaxGroupParams];
    HOLBA_CHECK_MSG(group.type->from_file(group.params.data(), values),
                    "invalid group " + std::to_string(selected.id));
    const BlockId block =
        problem_.AddBlock(group.type->name, *group.type->manifold, BlockRole::kGroup,
                          {values, static_cast<size_t>(group.type->manifold->ambient)});
    problem_.block(block).constant = selected.constant;
    group_idx_.Add(selected.id);
    groups_.push_back({block, &group});
    out_.groups.emplace_back(selected.id, block);
  }
}

void ProblemBuilder::AddGroupTerms() {
  for (size_t k = 0; k < selection_.groups.size(); ++k) {
    const SelectedGroup& selected = selection_.groups[k];
    const group3D_t id = selected.id;
    const GroupType& type = *groups_[k].record->type;
    if (filter_.groups.contains(id)) continue;
    const auto halvings = filter_.halvings.find(id);
    weight_halvings_ = halvings != filter_.halvings.end() ? halvings->second : 0;
    for (point3D_t point_id : selected.point3D_ids) {
      const Feature<Point3D>* point = PointOf(point_id);
      if (point != nullptr && !filter_.points.contains({id, point_id}))
        AddGroupPoint(type, groups_[k].block, *point);
    }
    for (line3D_t line_id : selected.line3D_ids) {
      const Feature<Line3D>* line = LineOf(line_id);
      if (line != nullptr && !filter_.lines.contains({id, line_id}))
        AddGroupLine(type, groups_[k].block, *line);
    }
  }
  weight_halvings_ = 0;
}

void ProblemBuilder::AddGroupPoint(const GroupType& type, BlockId group,
                                   const Feature<Point3D>& point) {
  if (options_.group_form == StructureForm::k3d) {
    auto& batch = BatchOf<GroupPoint3dResidual>("group_point_3d", {3, type.manifold->tangent},
                                                {-1, type.code, 0},
                                                [&] { return GroupPoint3dResidual{&type}; });
    Use3dWeight(options_.group_3d_weight, &batch);
    batch.Add(std::array{point.block, group}, {});
    return;
  }
  BatchOfImages<GroupPointResidual> batches(this);
  ForEachObservation(point.record->track, [&](const ImageBlocks& image, const PointObservation&) {
    batches.Add(image, std::array{point.block, image.pose, image.camera, group}, {image.sensor},
                [&] {
                  return BatchOfKernel<GroupPointResidual>{
                      "group_point",
                      {3, 6, image.model->num_params, type.manifold->tangent},
                      {image.model->id, type.code, 0},
                      {image.model, &type}};
                });
  });
}

void ProblemBuilder::AddGroupLine(const GroupType& type, BlockId group,
                                  const Feature<Line3D>& line) {
  if (type.IsParallelism()) {
    auto& batch =
        BatchOf<VanishingPointResidual>("vp", {4, type.manifold->tangent}, {-1, type.code, 0},
                                        [&] { return VanishingPointResidual{&type}; });
    batch.Add(std::array{line.block, group}, {});
    return;
  }
  if (options_.group_form == StructureForm::k3d) {
    auto& batch = BatchOf<GroupLine3dResidual>("group_line_3d", {4, type.manifold->tangent},
                                               {-1, type.code, 0},
                                               [&] { return GroupLine3dResidual{&type}; });
    Use3dWeight(options_.group_3d_weight, &batch);
    const double* values = problem_.values(line.block);
    const Eigen::Map<const Eigen::Vector3d> d(values), p(values + 3);
    batch.Add(std::array{line.block, group},
              {{d.dot(line.record->start - p), d.dot(line.record->end - p)}});
    return;
  }
  BatchOfImages<GroupLineResidual> batches(this);
  ForEachObservation(line.record->track, [&](const ImageBlocks& image, const LineObservation& o) {
    batches.Add(image, std::array{line.block, image.pose, image.camera, group}, DatumOf(image, o),
                [&] {
                  return BatchOfKernel<GroupLineResidual>{
                      "group_line",
                      {4, 6, image.model->num_params, type.manifold->tangent},
                      {image.model->id, type.code, image.observations_move},
                      {{image.model, image.observations_move}, &type}};
                });
  });
}

void ProblemBuilder::AddRelations() {
  for (const Relation& relation : selection_.relations) {
    if (filter_.groups.contains(relation.group3D_id1) ||
        filter_.groups.contains(relation.group3D_id2))
      continue;
    const uint32_t first = group_idx_.Find(relation.group3D_id1),
                   second = group_idx_.Find(relation.group3D_id2);
    if (first == FlatIndex::kNone || second == FlatIndex::kNone) continue;
    const GroupType* a = groups_[first].record->type;
    const GroupType* b = groups_[second].record->type;
    const std::array blocks{groups_[first].block, groups_[second].block};
    const std::initializer_list<int> tangents{a->manifold->tangent, b->manifold->tangent};
    if (relation.type == RelationType::kOrthogonal) {
      BatchOf<OrthogonalResidual>("relation", tangents, {0, a->code, b->code}, [&] {
        return OrthogonalResidual{{a, b}};
      }).Add(blocks, {});
    } else {
      BatchOf<ParallelResidual>("relation", tangents, {1, a->code, b->code}, [&] {
        return ParallelResidual{{a, b}};
      }).Add(blocks, {});
    }
  }
}

void ProblemBuilder::AddMeasurements(std::span<const GroupMeasurement> measurements) {
  for (const GroupMeasurement& measurement : measurements) {
    const ImageBlocks* image = ImageOf(measurement.image_id);
    const uint32_t group = group_idx_.Find(measurement.group3D_id);
    if (image == nullptr || group == FlatIndex::kNone) continue;
    const GroupType* type = groups_[group].record->type;
    BatchOfImages<GroupMeasurementResidual>(this).Add(
        *image, std::array{groups_[group].block, image->pose},
        {measurement.direction_in_cam.normalized(), DegToRad(measurement.sigma_deg), image->sensor},
        [&] {
          return BatchOfKernel<GroupMeasurementResidual>{
              "group_measurement", {type->manifold->tangent, 6}, {-1, type->code, 0}, {type}};
        });
  }
}

}  // namespace holba
