// SPDX-License-Identifier: BSD-3-Clause
#include "holba/scene/association_index.h"

#include <fmt/format.h>

namespace holba {
namespace {

// Sorted, for comparison.
std::unordered_map<uint64_t, std::vector<uint64_t>> Sorted(
    std::unordered_map<uint64_t, std::vector<uint64_t>> lists) {
  for (auto& [key, list] : lists) std::sort(list.begin(), list.end());
  return lists;
}

}  // namespace

AssociationIndex::AssociationIndex(const Reconstruction& model) {
  const auto add_once = [](std::vector<uint64_t>* list, uint64_t id) {
    // Groups come one after the other: only the last entry can be the same.
    if (list->empty() || list->back() != id) list->push_back(id);
  };
  for (const auto& [id, group] : model.groups3D) {
    for (const point3D_t point : group.point3D_ids) add_once(&groups_of_point_[point], id);
    for (const line3D_t line : group.line3D_ids) add_once(&groups_of_line_[line], id);
  }
  for (size_t i = 0; i < model.wireframe.size(); ++i) {
    const WireframeEdge& edge = model.wireframe[i];
    if (!PositionOfEdge(edge.point3D_id, edge.line3D_id))
      AddEdge(edge.point3D_id, edge.line3D_id, i);
  }
}

std::optional<std::string> AssociationIndex::FindDifference(const Reconstruction& model) const {
  const AssociationIndex actual(model);
  if (Sorted(groups_of_point_) != Sorted(actual.groups_of_point_))
    return "the index of the groups of points is not that of the groups";
  if (Sorted(groups_of_line_) != Sorted(actual.groups_of_line_))
    return "the index of the groups of lines is not that of the groups";
  if (Sorted(lines_of_point_) != Sorted(actual.lines_of_point_) ||
      Sorted(points_of_line_) != Sorted(actual.points_of_line_) ||
      position_of_edge_ != actual.position_of_edge_)
    return "the index of edges is not that of the wireframe";
  return std::nullopt;
}

}  // namespace holba
