// SPDX-License-Identifier: BSD-3-Clause
// What the features of a Reconstruction belong to: the way back from members to their groups and from the ends
// of edges to the edges. Part of Reconstruction, which keeps it in step.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#include "holba/base/check.h"
#include "holba/scene/reconstruction.h"

namespace holba {

class AssociationIndex {
 public:
  // Of the model's groups and edges. An association that the model holds twice counts once.
  explicit AssociationIndex(const Reconstruction& model);

  std::span<const group3D_t> GroupsOfPoint(point3D_t id) const { return Find(groups_of_point_, id); }
  std::span<const group3D_t> GroupsOfLine(line3D_t id) const { return Find(groups_of_line_, id); }
  std::span<const line3D_t> LinesThrough(point3D_t id) const { return Find(lines_of_point_, id); }
  std::span<const point3D_t> PointsOn(line3D_t id) const { return Find(points_of_line_, id); }
  // In Reconstruction::wireframe. Empty: they are not joined.
  std::optional<size_t> PositionOfEdge(point3D_t point3D_id, line3D_t line3D_id) const {
    const auto it = position_of_edge_.find({point3D_id, line3D_id});
    if (it == position_of_edge_.end()) return std::nullopt;
    return it->second;
  }

  void AddPointMember(group3D_t group, point3D_t point) { groups_of_point_[point].push_back(group); }
  void AddLineMember(group3D_t group, line3D_t line) { groups_of_line_[line].push_back(group); }
  void DeletePointMember(group3D_t group, point3D_t point) { Erase(point, group, &groups_of_point_); }
  void DeleteLineMember(group3D_t group, line3D_t line) { Erase(line, group, &groups_of_line_); }
  void AddEdge(point3D_t point, line3D_t line, size_t position) {
    lines_of_point_[point].push_back(line);
    points_of_line_[line].push_back(point);
    position_of_edge_[{point, line}] = position;
  }
  void MoveEdge(point3D_t point, line3D_t line, size_t position) {
    position_of_edge_.at({point, line}) = position;
  }
  void DeleteEdge(point3D_t point, line3D_t line) {
    Erase(point, line, &lines_of_point_);
    Erase(line, point, &points_of_line_);
    position_of_edge_.erase({point, line});
  }

  // Whether this is the index of the model as it stands; if not, what it has got wrong.
  std::optional<std::string> FindDifference(const Reconstruction& model) const;

 private:
  using IdLists = std::unordered_map<uint64_t, std::vector<uint64_t>>;
  struct PairHash {
    size_t operator()(const std::pair<uint64_t, uint64_t>& pair) const {
      uint64_t h = pair.first * 0x9e3779b97f4a7c15ULL;
      h = (h ^ (h >> 32)) + pair.second * 0xbf58476d1ce4e5b9ULL;
      return h ^ (h >> 29);
    }
  };

  static std::span<const uint64_t> Find(const IdLists& lists, uint64_t id) {
    const auto it = lists.find(id);
    if (it == lists.end()) return {};
    return it->second;
  }
  static void Erase(uint64_t key, uint64_t value, IdLists* lists) {
    const auto it = lists->find(key);
    HOLBA_CHECK(it != lists->end());
    std::vector<uint64_t>& list = it->second;
    const auto at = std::find(list.begin(), list.end(), value);
    HOLBA_CHECK(at != list.end());
    *at = list.back();
    list.pop_back();
    if (list.empty()) lists->erase(it);
  }

  IdLists groups_of_point_, groups_of_line_, lines_of_point_, points_of_line_;
  std::unordered_map<std::pair<point3D_t, line3D_t>, size_t, PairHash> position_of_edge_;
};

}  // namespace holba
