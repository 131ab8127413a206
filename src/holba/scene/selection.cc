// SPDX-License-Identifier: BSD-3-Clause
#include "holba/scene/selection.h"

#include <algorithm>
#include <map>
#include <vector>

#include "holba/base/check.h"

namespace holba {

Reconstruction Select(Reconstruction part, const ModelSelection& selection) {
  if (selection.keep_point) {
    part.points3D.RemoveIf(
        [&](point3D_t id, const Point3D& point) { return !selection.keep_point(id, point); });
  }
  if (selection.keep_line) {
    part.lines3D.RemoveIf(
        [&](line3D_t id, const Line3D& line) { return !selection.keep_line(id, line); });
  }
  if (selection.keep_group) {
    part.groups3D.RemoveIf(
        [&](group3D_t id, const Group3D& group) { return !selection.keep_group(id, group); });
  }
  for (auto& [image_id, image] : part.images) {
    for (Point2D& point : image.points2D) {
      if (!part.points3D.contains(point.point3D_id)) point.point3D_id = kNoId;
    }
    for (Line2D& line : image.lines2D) {
      if (!part.lines3D.contains(line.line3D_id)) line.line3D_id = kNoId;
    }
    for (Group2D& group : image.groups2D) {
      if (!part.groups3D.contains(group.group3D_id)) group.group3D_id = kNoId;
    }
  }
  for (auto& [group_id, group] : part.groups3D) {
    std::erase_if(group.point3D_ids, [&](point3D_t id) { return !part.points3D.contains(id); });
    std::erase_if(group.line3D_ids, [&](line3D_t id) { return !part.lines3D.contains(id); });
  }
  std::erase_if(part.wireframe, [&](const WireframeEdge& edge) {
    return !part.points3D.contains(edge.point3D_id) || !part.lines3D.contains(edge.line3D_id);
  });
  std::erase_if(part.relations, [&](const Relation& relation) {
    return !part.groups3D.contains(relation.group3D_id1) ||
           !part.groups3D.contains(relation.group3D_id2);
  });
  return part;
}

void CopyValues(const Reconstruction& part, Reconstruction* model) {
  for (const auto& [id, camera] : part.cameras) model->cameras.at(id).params = camera.params;
  for (const auto& [id, frame] : part.frames) model->SetFramePose(id, frame.rig_from_world);
  for (const auto& [id, point] : part.points3D) {
    Point3D& to = model->points3D.at(id);
    to.xyz = point.xyz;
    to.error = point.error;
  }
  for (const auto& [id, line] : part.lines3D) {
    Line3D& to = model->lines3D.at(id);
    to.line = line.line;
    to.start = line.start;
    to.end = line.end;
    to.error = line.error;
  }
  for (const auto& [id, group] : part.groups3D) model->groups3D.at(id).params = group.params;
}

void RemoveStructure(Reconstruction* model) {
  for (auto& [image_id, image] : model->images) {
    image.lines2D.clear();
    image.groups2D.clear();
  }
  model->lines3D = {};
  model->groups3D = {};
  model->wireframe.clear();
  model->relations.clear();
}

void ObserveGroups(Reconstruction* model) {
  for (auto& [image_id, image] : model->images) {
    std::erase_if(image.groups2D, [](const Group2D& group) { return group.group3D_id != kNoId; });
  }
  for (auto& [group_id, group] : model->groups3D) {
    // By position in the list of images: their order decides that of the observations.
    std::map<size_t, Group2D> in_image;
    const auto of = [&](image_t image_id) -> Group2D& {
      Group2D& group2D = in_image[model->images.IndexOf(image_id)];
      group2D.type = group.type;
      group2D.group3D_id = group_id;
      return group2D;
    };
    for (point3D_t id : group.point3D_ids) {
      for (const PointObservation& o : model->points3D.at(id).track)
        of(o.image_id).point2D_idxs.push_back(o.point2D_idx);
    }
    for (line3D_t id : group.line3D_ids) {
      for (const LineObservation& o : model->lines3D.at(id).track)
        of(o.image_id).line2D_idxs.push_back(o.line2D_idx);
    }
    group.observations.clear();
    for (auto& [position, group2D] : in_image) {
      const auto tidy = [](auto* idxs) {
        std::sort(idxs->begin(), idxs->end());
        idxs->erase(std::unique(idxs->begin(), idxs->end()), idxs->end());
      };
      tidy(&group2D.point2D_idxs);
      tidy(&group2D.line2D_idxs);
      auto& [image_id, image] = *(model->images.begin() + position);
      group.observations.push_back({image_id, static_cast<group2D_t>(image.groups2D.size())});
      image.groups2D.push_back(std::move(group2D));
    }
  }
}

}  // namespace holba
