// SPDX-License-Identifier: BSD-3-Clause
// The verbs of Reconstruction that remove many records in one pass, and its index of associations.
#include <algorithm>
#include <utility>

#include "holba/scene/association_index.h"
#include "holba/scene/reconstruction.h"

namespace holba {

Reconstruction::Reconstruction() = default;
Reconstruction::~Reconstruction() = default;
Reconstruction::Reconstruction(Reconstruction&& other) noexcept = default;
Reconstruction& Reconstruction::operator=(Reconstruction&& other) noexcept = default;
// The copy makes its own index when it needs one.
Reconstruction::Reconstruction(const Reconstruction& other)
    : cameras(other.cameras),
      rigs(other.rigs),
      frames(other.frames),
      images(other.images),
      unregistered_frames(other.unregistered_frames),
      unregistered_images(other.unregistered_images),
      points3D(other.points3D),
      lines3D(other.lines3D),
      groups3D(other.groups3D),
      wireframe(other.wireframe),
      relations(other.relations),
      has_rig_files(other.has_rig_files) {}
Reconstruction& Reconstruction::operator=(const Reconstruction& other) {
  if (this != &other) *this = Reconstruction(other);
  return *this;
}

AssociationIndex& Reconstruction::Associations() const {
  if (!associations_) associations_ = std::make_unique<AssociationIndex>(*this);
  return *associations_;
}
std::span<const group3D_t> Reconstruction::GroupsOfPoint(point3D_t point3D_id) const {
  return Associations().GroupsOfPoint(point3D_id);
}
std::span<const group3D_t> Reconstruction::GroupsOfLine(line3D_t line3D_id) const {
  return Associations().GroupsOfLine(line3D_id);
}
std::span<const line3D_t> Reconstruction::LinesThrough(point3D_t point3D_id) const {
  return Associations().LinesThrough(point3D_id);
}
std::span<const point3D_t> Reconstruction::PointsOn(line3D_t line3D_id) const {
  return Associations().PointsOn(line3D_id);
}
std::optional<size_t> Reconstruction::PositionOfEdge(point3D_t point3D_id,
                                                     line3D_t line3D_id) const {
  return Associations().PositionOfEdge(point3D_id, line3D_id);
}

void Reconstruction::DeletePoints3D(const std::function<bool(point3D_t, const Point3D&)>& remove) {
  if (points3D.RemoveIf(remove) == 0) return;
  for (auto& [image_id, image] : images) {
    for (Point2D& point : image.points2D) {
      if (point.point3D_id != kNoId && !points3D.contains(point.point3D_id)) point.point3D_id = kNoId;
    }
  }
  DeleteEdges([&](const WireframeEdge& edge) { return !points3D.contains(edge.point3D_id); });
  DeleteMembers([&](group3D_t, const Group3D&, point3D_t id) { return !points3D.contains(id); }, {});
}

void Reconstruction::DeleteLines3D(const std::function<bool(line3D_t, const Line3D&)>& remove) {
  if (lines3D.RemoveIf(remove) == 0) return;
  for (auto& [image_id, image] : images) {
    for (Line2D& line : image.lines2D) {
      if (line.line3D_id != kNoId && !lines3D.contains(line.line3D_id)) line.line3D_id = kNoId;
    }
  }
  DeleteEdges([&](const WireframeEdge& edge) { return !lines3D.contains(edge.line3D_id); });
  DeleteMembers({}, [&](group3D_t, const Group3D&, line3D_t id) { return !lines3D.contains(id); });
}

void Reconstruction::DeleteGroups3D(const std::function<bool(group3D_t, const Group3D&)>& remove) {
  if (groups3D.RemoveIf(remove) == 0) return;
  associations_.reset();
  for (auto& [image_id, image] : images) {
    for (Group2D& group : image.groups2D) {
      if (group.group3D_id != kNoId && !groups3D.contains(group.group3D_id)) group.group3D_id = kNoId;
    }
  }
  std::erase_if(relations, [&](const Relation& relation) {
    return !groups3D.contains(relation.group3D_id1) || !groups3D.contains(relation.group3D_id2);
  });
}

size_t Reconstruction::DeleteMembers(
    const std::function<bool(group3D_t, const Group3D&, point3D_t)>& remove_point,
    const std::function<bool(group3D_t, const Group3D&, line3D_t)>& remove_line) {
  size_t count = 0;
  for (auto& [group_id, group] : groups3D) {
    const group3D_t id = group_id;
    const Group3D& all = group;
    if (remove_point)
      count += std::erase_if(group.point3D_ids, [&](point3D_t point) { return remove_point(id, all, point); });
    if (remove_line)
      count += std::erase_if(group.line3D_ids, [&](line3D_t line) { return remove_line(id, all, line); });
  }
  if (count > 0) associations_.reset();
  return count;
}

size_t Reconstruction::DeleteEdges(const std::function<bool(const WireframeEdge&)>& remove) {
  const size_t count = std::erase_if(wireframe, remove);
  if (count > 0) associations_.reset();
  return count;
}

}  // namespace holba
