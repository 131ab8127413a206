// SPDX-License-Identifier: BSD-3-Clause
// The verbs of Reconstruction that change single records: what ties them to each other is changed at both ends.
#include <algorithm>
#include <array>
#include <set>
#include <string>
#include <utility>

#include "holba/base/check.h"
#include "holba/scene/association_index.h"
#include "holba/scene/reconstruction.h"

namespace holba {
namespace {

// The 2D feature of an observation and the id that it holds.
Point2D& FeatureOf(const PointObservation& o, IdMap<image_t, Image>* images) {
  std::vector<Point2D>& points = images->at(o.image_id).points2D;
  HOLBA_CHECK_MSG(o.point2D_idx < points.size(), "no such 2D point");
  return points[o.point2D_idx];
}
Line2D& FeatureOf(const LineObservation& o, IdMap<image_t, Image>* images) {
  std::vector<Line2D>& lines = images->at(o.image_id).lines2D;
  HOLBA_CHECK_MSG(o.line2D_idx < lines.size(), "no such 2D line");
  return lines[o.line2D_idx];
}
Group2D& FeatureOf(const GroupObservation& o, IdMap<image_t, Image>* images) {
  std::vector<Group2D>& groups = images->at(o.image_id).groups2D;
  HOLBA_CHECK_MSG(o.group2D_idx < groups.size(), "no such 2D group");
  return groups[o.group2D_idx];
}
uint64_t& IdOf(Point2D& point) { return point.point3D_id; }
uint64_t& IdOf(Line2D& line) { return line.line3D_id; }
uint64_t& IdOf(Group2D& group) { return group.group3D_id; }

bool Contains(std::span<const uint64_t> ids, uint64_t id) {
  return std::find(ids.begin(), ids.end(), id) != ids.end();
}

// The order of the others stays. The value must be there.
template <typename T>
void EraseOne(const T& value, std::vector<T>* list) {
  const auto it = std::find(list->begin(), list->end(), value);
  HOLBA_CHECK(it != list->end());
  list->erase(it);
}

// Ties `observation` to the feature `id` whose track this is.
template <typename Observation>
void Observe(uint64_t id, const Observation& observation, std::vector<Observation>* track,
             IdMap<image_t, Image>* images) {
  uint64_t& observed = IdOf(FeatureOf(observation, images));
  HOLBA_CHECK_MSG(observed == kNoId, "the 2D feature observes " + std::to_string(observed));
  observed = id;
  track->push_back(observation);
}

template <typename Observation>
void CheckIsFree(std::span<const Observation> track, IdMap<image_t, Image>* images) {
  for (size_t i = 0; i < track.size(); ++i) {
    HOLBA_CHECK_MSG(IdOf(FeatureOf(track[i], images)) == kNoId, "a 2D feature observes another");
    for (size_t k = 0; k < i; ++k) HOLBA_CHECK_MSG(!(track[i] == track[k]), "an observation twice");
  }
}

template <typename Observation>
void Forget(const std::vector<Observation>& track, IdMap<image_t, Image>* images) {
  for (const Observation& o : track) IdOf(FeatureOf(o, images)) = kNoId;
}

// Gives the observations of one feature to another.
template <typename Observation>
void Carry(uint64_t to, const std::vector<Observation>& from, std::vector<Observation>* track,
           IdMap<image_t, Image>* images) {
  for (const Observation& o : from) IdOf(FeatureOf(o, images)) = to;
  track->insert(track->end(), from.begin(), from.end());
}

template <typename Id>
bool HasTwice(std::vector<Id> ids) {
  std::sort(ids.begin(), ids.end());
  return std::adjacent_find(ids.begin(), ids.end()) != ids.end();
}

void CheckMembers(const GroupType& type, const std::vector<point3D_t>& point3D_ids,
                  const std::vector<line3D_t>& line3D_ids, const Reconstruction& model) {
  HOLBA_CHECK_MSG((point3D_ids.empty() || type.TakesPoints()) && (line3D_ids.empty() || type.TakesLines()),
                  "members of a kind that the group does not take");
  for (const point3D_t id : point3D_ids) HOLBA_CHECK_MSG(model.points3D.contains(id), "no such point");
  for (const line3D_t id : line3D_ids) HOLBA_CHECK_MSG(model.lines3D.contains(id), "no such line");
  HOLBA_CHECK_MSG(!HasTwice(point3D_ids) && !HasTwice(line3D_ids), "a member twice");
}

std::vector<uint64_t> Copy(std::span<const uint64_t> ids) { return {ids.begin(), ids.end()}; }

}  // namespace

point3D_t Reconstruction::AddPoint3D(const Eigen::Vector3d& xyz,
                                     std::span<const PointObservation> track, PointOrigin origin,
                                     const std::array<uint8_t, 3>& rgb) {
  CheckIsFree(track, &images);
  const point3D_t id = points3D.NextId();
  points3D.Add(id, {.xyz = xyz, .rgb = rgb, .origin = origin});
  Point3D& point = points3D.at(id);
  for (const PointObservation& o : track) Observe(id, o, &point.track, &images);
  return id;
}

line3D_t Reconstruction::AddLine3D(const PlueckerLine& line, const Eigen::Vector3d& start,
                                   const Eigen::Vector3d& end,
                                   std::span<const LineObservation> track) {
  CheckIsFree(track, &images);
  const line3D_t id = lines3D.NextId();
  lines3D.Add(id, {.line = line, .start = start, .end = end});
  Line3D& added = lines3D.at(id);
  for (const LineObservation& o : track) Observe(id, o, &added.track, &images);
  return id;
}

void Reconstruction::AddObservation(point3D_t point3D_id, const PointObservation& observation) {
  Observe(point3D_id, observation, &points3D.at(point3D_id).track, &images);
}
void Reconstruction::AddObservation(line3D_t line3D_id, const LineObservation& observation) {
  Observe(line3D_id, observation, &lines3D.at(line3D_id).track, &images);
}
void Reconstruction::DeleteObservation(const PointObservation& observation) {
  point3D_t& id = FeatureOf(observation, &images).point3D_id;
  HOLBA_CHECK_MSG(id != kNoId, "the 2D point observes nothing");
  EraseOne(observation, &points3D.at(id).track);
  id = kNoId;
}
void Reconstruction::DeleteObservation(const LineObservation& observation) {
  line3D_t& id = FeatureOf(observation, &images).line3D_id;
  HOLBA_CHECK_MSG(id != kNoId, "the 2D line observes nothing");
  EraseOne(observation, &lines3D.at(id).track);
  id = kNoId;
}

void Reconstruction::DeletePoint3D(point3D_t point3D_id) {
  Forget(points3D.at(point3D_id).track, &images);
  for (const group3D_t group : Copy(GroupsOfPoint(point3D_id))) DeletePointMember(group, point3D_id);
  for (const line3D_t line : Copy(LinesThrough(point3D_id))) DeleteEdge(point3D_id, line);
  points3D.Remove(point3D_id);
}
void Reconstruction::DeleteLine3D(line3D_t line3D_id) {
  Forget(lines3D.at(line3D_id).track, &images);
  for (const group3D_t group : Copy(GroupsOfLine(line3D_id))) DeleteLineMember(group, line3D_id);
  for (const point3D_t point : Copy(PointsOn(line3D_id))) DeleteEdge(point, line3D_id);
  lines3D.Remove(line3D_id);
}

void Reconstruction::MergePoints3D(point3D_t id, point3D_t other) {
  HOLBA_CHECK_MSG(id != other, "a point cannot be merged with itself");
  Point3D& kept = points3D.at(id);
  Point3D& gone = points3D.at(other);
  const double n1 = static_cast<double>(kept.track.size()), n2 = static_cast<double>(gone.track.size());
  if (n1 + n2 > 0.0) kept.xyz = (n1 * kept.xyz + n2 * gone.xyz) / (n1 + n2);
  kept.error = -1.0;
  Carry(id, gone.track, &kept.track, &images);
  gone.track.clear();
  for (const group3D_t group : Copy(GroupsOfPoint(other))) AddPointMember(group, id);
  for (const line3D_t line : Copy(LinesThrough(other)))
    AddEdge({id, line, wireframe[*PositionOfEdge(other, line)].num_images});
  DeletePoint3D(other);
}

void Reconstruction::MergeLines3D(line3D_t id, line3D_t other) {
  HOLBA_CHECK_MSG(id != other, "a line cannot be merged with itself");
  Line3D& kept = lines3D.at(id);
  Line3D& gone = lines3D.at(other);
  // The extent along the kept line that both cover.
  const Eigen::Vector3d anchor = kept.line.ClosestPoint(kept.start), d = kept.line.direction;
  std::array<double, 4> at;
  const std::array<const Eigen::Vector3d*, 4> ends{&kept.start, &kept.end, &gone.start, &gone.end};
  for (size_t k = 0; k < 4; ++k) at[k] = d.dot(*ends[k] - anchor);
  const auto [low, high] = std::minmax_element(at.begin(), at.end());
  const bool forward = at[1] >= at[0];
  kept.start = anchor + (forward ? *low : *high) * d;
  kept.end = anchor + (forward ? *high : *low) * d;
  kept.error = -1.0;
  Carry(id, gone.track, &kept.track, &images);
  gone.track.clear();
  for (const group3D_t group : Copy(GroupsOfLine(other))) AddLineMember(group, id);
  for (const point3D_t point : Copy(PointsOn(other)))
    AddEdge({point, id, wireframe[*PositionOfEdge(point, other)].num_images});
  DeleteLine3D(other);
}

group3D_t Reconstruction::AddGroup3D(const GroupType& type, std::vector<double> params,
                                     std::vector<point3D_t> point3D_ids,
                                     std::vector<line3D_t> line3D_ids) {
  HOLBA_CHECK_MSG(params.size() == static_cast<size_t>(type.num_file_params),
                  "a group with a wrong number of parameters");
  CheckMembers(type, point3D_ids, line3D_ids, *this);
  const group3D_t id = groups3D.NextId();
  groups3D.Add(id, {.type = &type, .params = std::move(params)});
  SetMembers(id, std::move(point3D_ids), std::move(line3D_ids));
  return id;
}

void Reconstruction::DeleteGroup3D(group3D_t group3D_id) {
  Group3D& group = groups3D.at(group3D_id);
  AssociationIndex& index = Associations();
  for (const point3D_t point : group.point3D_ids) index.DeletePointMember(group3D_id, point);
  for (const line3D_t line : group.line3D_ids) index.DeleteLineMember(group3D_id, line);
  Forget(group.observations, &images);
  std::erase_if(relations, [&](const Relation& relation) {
    return relation.group3D_id1 == group3D_id || relation.group3D_id2 == group3D_id;
  });
  groups3D.Remove(group3D_id);
}

bool Reconstruction::AddPointMember(group3D_t group3D_id, point3D_t point3D_id) {
  Group3D& group = groups3D.at(group3D_id);
  HOLBA_CHECK_MSG(points3D.contains(point3D_id) && group.type->TakesPoints(),
                  "no such point, or a group that takes no points");
  if (Contains(GroupsOfPoint(point3D_id), group3D_id)) return false;
  group.point3D_ids.push_back(point3D_id);
  Associations().AddPointMember(group3D_id, point3D_id);
  return true;
}
bool Reconstruction::AddLineMember(group3D_t group3D_id, line3D_t line3D_id) {
  Group3D& group = groups3D.at(group3D_id);
  HOLBA_CHECK_MSG(lines3D.contains(line3D_id) && group.type->TakesLines(),
                  "no such line, or a group that takes no lines");
  if (Contains(GroupsOfLine(line3D_id), group3D_id)) return false;
  group.line3D_ids.push_back(line3D_id);
  Associations().AddLineMember(group3D_id, line3D_id);
  return true;
}
bool Reconstruction::DeletePointMember(group3D_t group3D_id, point3D_t point3D_id) {
  if (!Contains(GroupsOfPoint(point3D_id), group3D_id)) return false;
  EraseOne(point3D_id, &groups3D.at(group3D_id).point3D_ids);
  Associations().DeletePointMember(group3D_id, point3D_id);
  return true;
}
bool Reconstruction::DeleteLineMember(group3D_t group3D_id, line3D_t line3D_id) {
  if (!Contains(GroupsOfLine(line3D_id), group3D_id)) return false;
  EraseOne(line3D_id, &groups3D.at(group3D_id).line3D_ids);
  Associations().DeleteLineMember(group3D_id, line3D_id);
  return true;
}

void Reconstruction::SetMembers(group3D_t group3D_id, std::vector<point3D_t> point3D_ids,
                                std::vector<line3D_t> line3D_ids) {
  Group3D& group = groups3D.at(group3D_id);
  CheckMembers(*group.type, point3D_ids, line3D_ids, *this);
  if (associations_) {
    for (const point3D_t id : group.point3D_ids) associations_->DeletePointMember(group3D_id, id);
    for (const line3D_t id : group.line3D_ids) associations_->DeleteLineMember(group3D_id, id);
    for (const point3D_t id : point3D_ids) associations_->AddPointMember(group3D_id, id);
    for (const line3D_t id : line3D_ids) associations_->AddLineMember(group3D_id, id);
  }
  group.point3D_ids = std::move(point3D_ids);
  group.line3D_ids = std::move(line3D_ids);
}

void Reconstruction::AddObservation(group3D_t group3D_id, const GroupObservation& observation) {
  Group3D& group = groups3D.at(group3D_id);
  HOLBA_CHECK_MSG(FeatureOf(observation, &images).type == group.type, "groups of different types");
  Observe(group3D_id, observation, &group.observations, &images);
}
void Reconstruction::DeleteObservation(const GroupObservation& observation) {
  group3D_t& id = FeatureOf(observation, &images).group3D_id;
  HOLBA_CHECK_MSG(id != kNoId, "the 2D group observes nothing");
  EraseOne(observation, &groups3D.at(id).observations);
  id = kNoId;
}

void Reconstruction::MergeGroups3D(group3D_t id, group3D_t other) {
  HOLBA_CHECK_MSG(id != other, "a group cannot be merged with itself");
  Group3D& kept = groups3D.at(id);
  Group3D& gone = groups3D.at(other);
  HOLBA_CHECK_MSG(kept.type == gone.type, "groups of different types");
  for (const point3D_t point : gone.point3D_ids) AddPointMember(id, point);
  for (const line3D_t line : gone.line3D_ids) AddLineMember(id, line);
  Carry(id, gone.observations, &kept.observations, &images);
  gone.observations.clear();
  // Relations of `other` become those of `id`; where both had one to a third group, the first stays.
  std::set<std::pair<group3D_t, group3D_t>> known;
  std::erase_if(relations, [&](Relation& relation) {
    for (group3D_t* end : {&relation.group3D_id1, &relation.group3D_id2}) {
      if (*end == other) *end = id;
    }
    return relation.group3D_id1 == relation.group3D_id2 ||
           !known.insert(std::minmax(relation.group3D_id1, relation.group3D_id2)).second;
  });
  DeleteGroup3D(other);
}

bool Reconstruction::AddEdge(const WireframeEdge& edge) {
  HOLBA_CHECK_MSG(points3D.contains(edge.point3D_id) && lines3D.contains(edge.line3D_id),
                  "an edge between what does not exist");
  AssociationIndex& index = Associations();
  if (index.PositionOfEdge(edge.point3D_id, edge.line3D_id)) return false;
  index.AddEdge(edge.point3D_id, edge.line3D_id, wireframe.size());
  wireframe.push_back(edge);
  return true;
}
bool Reconstruction::DeleteEdge(point3D_t point3D_id, line3D_t line3D_id) {
  AssociationIndex& index = Associations();
  const auto position = index.PositionOfEdge(point3D_id, line3D_id);
  if (!position) return false;
  index.DeleteEdge(point3D_id, line3D_id);
  const WireframeEdge last = wireframe.back();
  wireframe.pop_back();
  if (*position < wireframe.size()) {
    wireframe[*position] = last;
    index.MoveEdge(last.point3D_id, last.line3D_id, *position);
  }
  return true;
}

bool Reconstruction::AddRelation(const Relation& relation) {
  const Group3D& a = groups3D.at(relation.group3D_id1);
  const Group3D& b = groups3D.at(relation.group3D_id2);
  HOLBA_CHECK_MSG(relation.group3D_id1 != relation.group3D_id2 && a.type->HasDirection() && b.type->HasDirection(),
                  "a relation of groups without directions, or of a group with itself");
  const bool known = std::any_of(relations.begin(), relations.end(), [&](const Relation& r) {
    return std::minmax(r.group3D_id1, r.group3D_id2) == std::minmax(relation.group3D_id1, relation.group3D_id2);
  });
  if (!known) relations.push_back(relation);
  return !known;
}
bool Reconstruction::DeleteRelation(group3D_t group3D_id1, group3D_t group3D_id2) {
  return std::erase_if(relations, [&](const Relation& r) {
           return std::minmax(r.group3D_id1, r.group3D_id2) == std::minmax(group3D_id1, group3D_id2);
         }) > 0;
}

}  // namespace holba
