// SPDX-License-Identifier: BSD-3-Clause
#include "holba/estimation/groups/plane_members.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <optional>
#include <set>
#include <unordered_map>
#include <unordered_set>
#include <vector>

#include "holba/base/threads.h"
#include "holba/estimation/groups/group_estimation.h"
#include "holba/geometry/manifold.h"
#include "holba/group/known_types.h"
#include "holba/robust/kd_tree.h"

namespace holba {
namespace {

using Polygon = std::vector<Eigen::Vector2d>;

double Cross(const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
  return a.x() * b.y() - a.y() * b.x();
}

// Counter-clockwise (Andrew's monotone chain).
Polygon ConvexHull(Polygon points) {
  if (points.empty()) return {};
  std::sort(points.begin(), points.end(), [](const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
    return a.x() != b.x() ? a.x() < b.x() : a.y() < b.y();
  });
  Polygon hull;
  for (int side = 0; side < 2; ++side) {
    const size_t first = hull.size();
    for (const Eigen::Vector2d& p : points) {
      while (hull.size() >= first + 2 &&
             Cross(hull.back() - hull[hull.size() - 2], p - hull.back()) <= 0.0) {
        hull.pop_back();
      }
      hull.push_back(p);
    }
    hull.pop_back();  // the first of the other side
    std::reverse(points.begin(), points.end());
  }
  return hull;
}

bool IsInside(const Polygon& hull, const Eigen::Vector2d& p) {
  if (hull.size() < 3) return false;
  for (size_t i = 0; i < hull.size(); ++i) {
    const Eigen::Vector2d& a = hull[i];
    if (Cross(hull[(i + 1) % hull.size()] - a, p - a) < 0.0) return false;
  }
  return true;
}

// A plane and where its member points are.
struct PlaneExtent {
  group3D_t id = kNoId;
  const Group3D* group = nullptr;
  Eigen::Vector3d n = Eigen::Vector3d::UnitZ();
  double w = 0.0;
  Eigen::Matrix<double, 3, 2> basis;
  KdTree tree{{}};
  Polygon hull;

  double Distance(const Eigen::Vector3d& X) const { return std::abs(n.dot(X) + w); }
  bool IsNearMembers(const Eigen::Vector3d& X, double reach) const {
    if (tree.size() < 2) return false;
    // The second nearest decides: a single wrong member must not attract others.
    const std::vector<KdTree::Neighbour> nearest = tree.Nearest(X, 2);
    return nearest.size() == 2 && nearest[1].squared_distance <= reach * reach;
  }
  bool IsInsideHull(const Eigen::Vector3d& X) const {
    return IsInside(hull, basis.transpose() * X);
  }
};

std::vector<PlaneExtent> PlanesOf(const Reconstruction& model) {
  std::vector<PlaneExtent> planes;
  for (const auto& [id, group] : model.groups3D) {
    if (!IsPlane(*group.type)) continue;
    PlaneExtent plane;
    plane.id = id;
    plane.group = &group;
    plane.n = Eigen::Vector3d(group.params[0], group.params[1], group.params[2]);
    plane.w = group.params[3];
    plane.basis = TangentBasis(plane.n);
    std::vector<Eigen::Vector3d> members;
    Polygon flat;
    for (const point3D_t point_id : group.point3D_ids) {
      const Point3D* point = model.points3D.Find(point_id);
      if (!point) continue;
      members.push_back(point->xyz);
      flat.push_back(plane.basis.transpose() * point->xyz);
    }
    plane.tree = KdTree(members);
    plane.hull = ConvexHull(std::move(flat));
    planes.push_back(std::move(plane));
  }
  return planes;
}

// Whether a feature is on a plane and, if not, why.
enum class Verdict : uint8_t { kFar, kOneEnd, kApart, kOther, kOn };

// Of planes that meet at a smaller angle a feature is on the nearest only.
constexpr double kSideBySideCosine = 0.866;  // 30 degrees

// Decides which of the planes that a feature may be on it is on. `is_member`: planes of which it is
// a member already.
void Choose(const std::vector<PlaneExtent>& planes, const std::vector<double>& distances,
            const std::vector<bool>& is_member, std::vector<Verdict>* verdicts) {
  std::vector<size_t> taken, order;
  for (size_t p = 0; p < planes.size(); ++p) {
    if (is_member[p]) {
      taken.push_back(p);
    } else if ((*verdicts)[p] == Verdict::kOn) {
      order.push_back(p);
    }
  }
  std::stable_sort(order.begin(), order.end(),
                   [&](size_t a, size_t b) { return distances[a] < distances[b]; });
  for (const size_t p : order) {
    const bool is_beside = std::any_of(taken.begin(), taken.end(), [&](size_t other) {
      return std::abs(planes[p].n.dot(planes[other].n)) > kSideBySideCosine;
    });
    if (is_beside) {
      (*verdicts)[p] = Verdict::kOther;
    } else {
      taken.push_back(p);
    }
  }
}

// For each feature and plane, whether it is a member.
template <typename Id>
std::unordered_map<Id, std::vector<bool>> MembersOf(const std::vector<PlaneExtent>& planes,
                                                    std::vector<Id> Group3D::*ids) {
  std::unordered_map<Id, std::vector<bool>> members;
  for (size_t p = 0; p < planes.size(); ++p) {
    for (const Id id : planes[p].group->*ids) {
      members.try_emplace(id, planes.size(), false).first->second[p] = true;
    }
  }
  return members;
}

// Decides for each candidate on the verdicts of judge(candidate, plane, &distance), and adds it to
// the planes that it is on by add(plane, candidate).
template <typename Id, typename Judge, typename Add>
PlaneMemberReport AddMembers(const std::vector<Id>& candidates, std::vector<Id> Group3D::*ids,
                             int num_threads, const std::vector<PlaneExtent>& planes,
                             const Judge& judge, const Add& add) {
  const auto members = MembersOf(planes, ids);
  const std::vector<bool> none(planes.size(), false);
  std::vector<std::vector<Verdict>> verdicts(candidates.size());
  ParallelFor(num_threads, candidates.size(), [&](size_t begin, size_t end) {
    std::vector<double> distances(planes.size());
    for (size_t i = begin; i < end; ++i) {
      const auto it = members.find(candidates[i]);
      const std::vector<bool>& is_member = it == members.end() ? none : it->second;
      verdicts[i].assign(planes.size(), Verdict::kFar);
      for (size_t p = 0; p < planes.size(); ++p) {
        if (!is_member[p]) verdicts[i][p] = judge(i, planes[p], &distances[p]);
      }
      Choose(planes, distances, is_member, &verdicts[i]);
    }
  });
  PlaneMemberReport report;
  std::unordered_set<Id> on_planes;
  for (const auto& [id, is_member] : members) on_planes.insert(id);
  for (size_t i = 0; i < candidates.size(); ++i) {
    for (size_t p = 0; p < planes.size(); ++p) {
      switch (verdicts[i][p]) {
        case Verdict::kFar:
          break;
        case Verdict::kOneEnd:
          ++report.dropped["one end off the plane"];
          break;
        case Verdict::kApart:
          ++report.dropped["away from the plane's points"];
          break;
        case Verdict::kOther:
          ++report.dropped["on a plane beside it"];
          break;
        case Verdict::kOn:
          add(planes[p].id, candidates[i]);
          on_planes.insert(candidates[i]);
          ++report.added;
          break;
      }
    }
  }
  report.features_on_planes = on_planes.size();
  return report;
}

}  // namespace

PlaneMemberReport AddLinesToPlanes(const PlaneMemberOptions& options, Reconstruction* model) {
  FeatureLookup lookup(*model);
  std::vector<line3D_t> candidates;
  std::vector<const MeasuredLine*> lines;
  size_t few_images = 0;
  for (const auto& [id, line] : model->lines3D) {
    std::set<image_t> images;
    for (const LineObservation& o : line.track) images.insert(o.image_id);
    if (images.size() < static_cast<size_t>(options.min_line_images)) {
      ++few_images;
    } else if (const MeasuredLine* fit = lookup.Line(id)) {
      candidates.push_back(id);
      lines.push_back(fit);
    }
  }
  const auto judge = [&](size_t i, const PlaneExtent& plane, double* distance) {
    const MeasuredLine& line = *lines[i];
    const double limit = options.max_distance_px * line.length_per_px;
    const double start = plane.Distance(line.start), end = plane.Distance(line.end);
    *distance = std::max(start, end);
    if (std::min(start, end) > limit) return Verdict::kFar;
    if (*distance > limit) return Verdict::kOneEnd;
    const double reach = options.max_neighbour_px * line.length_per_px;
    for (const Eigen::Vector3d& X : {line.start, line.end}) {
      if (!plane.IsNearMembers(X, reach) && !plane.IsInsideHull(X)) return Verdict::kApart;
    }
    return Verdict::kOn;
  };
  PlaneMemberReport report =
      AddMembers(candidates, &Group3D::line3D_ids, options.num_threads, PlanesOf(*model), judge,
                 [&](group3D_t plane, line3D_t id) { model->AddLineMember(plane, id); });
  if (few_images > 0) report.dropped["few images"] = few_images;
  return report;
}

PlaneMemberReport AddPointsToPlanes(const PlaneMemberOptions& options,
                                    std::span<const point3D_t> point_ids, Reconstruction* model) {
  const ViewMap views(*model);
  std::vector<point3D_t> candidates;
  std::unordered_set<point3D_t> seen;
  for (const point3D_t id : point_ids) {
    if (model->points3D.contains(id) && seen.insert(id).second) candidates.push_back(id);
  }
  if (point_ids.empty()) {
    for (const auto& [id, point] : model->points3D) candidates.push_back(id);
  }
  std::vector<std::optional<PointGeometry>> geometries(candidates.size());
  ParallelFor(options.num_threads, candidates.size(), [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      geometries[i] = GeometryOf(views, model->points3D.at(candidates[i]));
    }
  });
  const auto judge = [&](size_t i, const PlaneExtent& plane, double* distance) {
    const Eigen::Vector3d& X = model->points3D.at(candidates[i]).xyz;
    *distance = plane.Distance(X);
    if (!geometries[i] || *distance > options.max_distance_px * geometries[i]->LengthPerPx()) {
      return Verdict::kFar;
    }
    return plane.IsNearMembers(X, options.max_neighbour_px * geometries[i]->gsd) ? Verdict::kOn
                                                                                 : Verdict::kApart;
  };
  return AddMembers(candidates, &Group3D::point3D_ids, options.num_threads, PlanesOf(*model), judge,
                    [&](group3D_t plane, point3D_t id) { model->AddPointMember(plane, id); });
}

void PlaneMemberOptions::Describe(OptionTable* table) const {
  table->Section("PlaneMembers");
  table->Field("max_distance_px", &max_distance_px, GreaterThan(0),
               "Farthest from a plane that its lines and added points may be, in pixels.");
  table->Field("max_neighbour_px", &max_neighbour_px, GreaterThan(0),
               "Farthest from a plane's points that its lines and added points may be, in pixels.");
  table->Field("min_line_images", &min_line_images, AtLeast(2), "Fewest images of a line.");
}

}  // namespace holba
