// SPDX-License-Identifier: BSD-3-Clause
#include "holba/estimation/groups/plane_split.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <span>
#include <unordered_map>
#include <utility>

#include "holba/estimation/groups/plane_points.h"
#include "holba/geometry/manifold.h"
#include "holba/group/known_types.h"

namespace holba {
namespace {

constexpr int kMaxPasses = 5;
// Straight borders that are tried: directions of them, and quantiles of the points across each.
constexpr int kDirections = 6, kBorders = 12;
// Standard deviations from which on a point is wrong, and says no more.
constexpr double kMaxSigmas = 3.0;
// How far apart two planes are at least, in standard deviations of their points: what is nearer is
// one wall to all that uses it.
constexpr double kMinApartSigmas = 1.0;

double VarianceAlong(const PlanePoints& points, const PlaneParams& plane, uint32_t i) {
  return std::max(plane.n.dot(points[i].covariance * plane.n), 1e-300);
}

double Cost(const PlanePoints& points, const PlaneParams& plane, uint32_t i) {
  const double d = plane.Signed(points[i].X);
  return std::min(d * d / VarianceAlong(points, plane, i), kMaxSigmas * kMaxSigmas);
}

// Whether two planes explain their points enough better than one plane does.
bool AreTwo(const PlaneOptions& options, const PlanePoints& points, const FoundPlane& a,
            const FoundPlane& b) {
  std::vector<uint32_t> all = a.members;
  all.insert(all.end(), b.members.begin(), b.members.end());
  const PlaneParams one = points.Fit(all);
  double gain = 0.0;
  for (const FoundPlane* part : {&a, &b}) {
    if (part->members.size() < static_cast<size_t>(options.min_points) ||
        points.ShareOf(part->members) < options.min_share) {
      return false;
    }
    for (const uint32_t i : part->members)
      gain += Cost(points, one, i) - Cost(points, part->params, i);
  }
  const auto num_a = static_cast<double>(a.members.size()),
             num_b = static_cast<double>(b.members.size()), n = num_a + num_b;
  return gain > kMinApartSigmas * kMinApartSigmas * num_a * num_b / n && gain > 3.0 * std::log(n);
}

// The points of one plane as those of two, each a coherent part of it; empty: they are one. Two
// planes are at least one standard deviation of their points apart, have the fewest points of a
// plane each, and explain the points better than three more parameters cost (Bayesian information
// criterion).
class Splitter {
 public:
  Splitter(const PlaneOptions& options, const PlanePoints& points)
      : options_(options), points_(points) {}

  std::vector<FoundPlane> Run() {
    const size_t least = static_cast<size_t>(options_.min_points);
    if (points_.size() < 2 * least) return {};
    std::vector<uint32_t> all(points_.size());
    std::iota(all.begin(), all.end(), 0);
    const PlaneParams one = points_.Fit(all);
    std::vector<FoundPlane> parts = Start(one);
    if (parts.empty()) return {};
    for (int pass = 0; pass < kMaxPasses; ++pass) {
      for (FoundPlane& part : parts) {
        if (part.members.size() < least) return {};
        part.params = points_.Fit(part.members);
      }
      std::vector<FoundPlane> next = PartsByNeighbours(parts);
      const bool is_settled = next[0].members == parts[0].members;
      parts = std::move(next);
      if (is_settled) break;
    }
    if (!AreTwo(options_, points_, parts[0], parts[1])) return {};
    return parts;
  }

 private:
  // Signed distance of a point and those beside it, each as much as it is known.
  double MeanAround(const PlaneParams& plane, uint32_t i) const {
    double sum = 0.0, weights = 0.0;
    const auto add = [&](uint32_t j) {
      const double weight = 1.0 / VarianceAlong(points_, plane, j);
      sum += weight * plane.Signed(points_[j].X);
      weights += weight;
    };
    add(i);
    for (const uint32_t j : points_.Beside(i)) add(j);
    return sum / weights;
  }

  // Means on the two sides of the plane, parted where both sides scatter least (Otsu 1979).
  double Threshold(const PlaneParams& plane) {
    means_.resize(points_.size());
    for (uint32_t i = 0; i < points_.size(); ++i) means_[i] = MeanAround(plane, i);
    std::vector<double> sorted = means_;
    std::sort(sorted.begin(), sorted.end());
    const double total = std::accumulate(sorted.begin(), sorted.end(), 0.0);
    const auto size = static_cast<double>(sorted.size());
    double below = 0.0, greatest = -1.0, threshold = 0.0;
    for (size_t k = 0; k + 1 < sorted.size(); ++k) {
      below += sorted[k];
      const double num = static_cast<double>(k + 1);
      const double apart = below / num - (total - below) / (size - num);
      const double between = num * (size - num) * apart * apart;
      if (between <= greatest) continue;
      greatest = between;
      threshold = 0.5 * (sorted[k] + sorted[k + 1]);
    }
    return threshold;
  }

  // The start that explains the points best. On the two sides of one plane lie what is before and
  // behind a wall (recessed windows); where fronts are side by side one plane through both leans,
  // and it is a straight border that parts them.
  std::vector<FoundPlane> Start(const PlaneParams& one) {
    std::vector<FoundPlane> best;
    double least = HUGE_VAL;
    const auto consider = [&](std::span<const double> values, double threshold) {
      std::vector<FoundPlane> parts(2);
      for (uint32_t i = 0; i < points_.size(); ++i)
        parts[values[i] > threshold].members.push_back(i);
      double cost = 0.0;
      for (FoundPlane& part : parts) {
        if (part.members.size() < static_cast<size_t>(options_.min_points)) return;
        part.params = points_.Fit(part.members);
        for (const uint32_t i : part.members) cost += Cost(points_, part.params, i);
      }
      if (cost >= least) return;
      least = cost;
      best = std::move(parts);
    };
    const double threshold = Threshold(one);
    consider(means_, threshold);
    const Eigen::Matrix<double, 3, 2> basis = TangentBasis(one.n);
    std::vector<double> values(points_.size());
    for (int d = 0; d < kDirections; ++d) {
      const double angle = std::numbers::pi * d / kDirections;
      const Eigen::Vector3d across = basis * Eigen::Vector2d(std::cos(angle), std::sin(angle));
      for (uint32_t i = 0; i < points_.size(); ++i) values[i] = across.dot(points_[i].X);
      std::vector<double> sorted = values;
      std::sort(sorted.begin(), sorted.end());
      for (int k = 1; k < kBorders; ++k) consider(values, sorted[sorted.size() * k / kBorders]);
    }
    return best;
  }

  // A point is on the plane that explains it and those beside it better.
  std::vector<FoundPlane> PartsByNeighbours(const std::vector<FoundPlane>& parts) const {
    std::vector<double> gains(points_.size());
    for (uint32_t i = 0; i < points_.size(); ++i)
      gains[i] = Cost(points_, parts[0].params, i) - Cost(points_, parts[1].params, i);
    std::vector<FoundPlane> next = {{parts[0].params, {}, 0.0}, {parts[1].params, {}, 0.0}};
    for (uint32_t i = 0; i < points_.size(); ++i) {
      double sum = gains[i];
      for (const uint32_t j : points_.Beside(i)) sum += gains[j];
      next[sum > 0.0].members.push_back(i);
    }
    return next;
  }

  const PlaneOptions& options_;
  const PlanePoints& points_;
  std::vector<double> means_;  // MeanAround each point
};

// A point is on the plane that explains it and those beside it best, among the planes that they are
// on.
void Reassign(const PlanePoints& points, std::vector<FoundPlane>* parts) {
  std::vector<uint32_t> part_of(points.size());
  for (uint32_t k = 0; k < parts->size(); ++k) {
    for (const uint32_t i : (*parts)[k].members) part_of[i] = k;
  }
  for (FoundPlane& part : *parts) part.members.clear();
  for (uint32_t i = 0; i < points.size(); ++i) {
    uint32_t best = part_of[i];
    double least = HUGE_VAL;
    const auto consider = [&](uint32_t k) {
      double cost = Cost(points, (*parts)[k].params, i);
      for (const uint32_t j : points.Beside(i)) cost += Cost(points, (*parts)[k].params, j);
      if (cost >= least) return;
      least = cost;
      best = k;
    };
    consider(part_of[i]);
    for (const uint32_t j : points.Beside(i)) {
      if (part_of[j] != part_of[i]) consider(part_of[j]);
    }
    (*parts)[best].members.push_back(i);
  }
  std::erase_if(*parts, [](const FoundPlane& part) { return part.members.size() < 3; });
  for (FoundPlane& part : *parts) part.params = points.Fit(part.members);
}

// Makes one of parts that are no two planes. Returns whether there were any.
bool Join(const PlaneOptions& options, const PlanePoints& points, std::vector<FoundPlane>* parts) {
  for (size_t a = 0; a < parts->size(); ++a) {
    for (size_t b = a + 1; b < parts->size(); ++b) {
      FoundPlane &one = (*parts)[a], &other = (*parts)[b];
      if (AreTwo(options, points, one, other)) continue;
      one.members.insert(one.members.end(), other.members.begin(), other.members.end());
      std::sort(one.members.begin(), one.members.end());
      one.params = points.Fit(one.members);
      parts->erase(parts->begin() + static_cast<std::ptrdiff_t>(b));
      return true;
    }
  }
  return false;
}

// The planes that the points of one plane are on, the largest first. A border that is not the last
// one may run across a part: pieces are joined again where they are one.
std::vector<FoundPlane> PartsOf(const PlaneOptions& options, const PlanePoints& points) {
  std::vector<FoundPlane> parts;
  std::vector<std::vector<uint32_t>> open(1);
  open[0].resize(points.size());
  std::iota(open[0].begin(), open[0].end(), 0);
  while (!open.empty()) {
    const std::vector<uint32_t> members = std::move(open.back());
    open.pop_back();
    std::vector<PlanePoint> of_part;
    for (const uint32_t i : members) of_part.push_back(points[i]);
    const PlanePoints whole(options, std::move(of_part));
    const std::vector<FoundPlane> two = Splitter(options, whole).Run();
    if (two.empty()) parts.push_back({points.Fit(members), members, 0.0});
    for (const FoundPlane& part : two) {
      std::vector<uint32_t>& next = open.emplace_back();
      for (const uint32_t i : part.members) next.push_back(members[i]);
    }
  }
  const size_t most_joins = parts.size();
  for (size_t k = 0; k < most_joins && parts.size() > 1; ++k) {
    Reassign(points, &parts);
    if (!Join(options, points, &parts)) break;
  }
  std::stable_sort(parts.begin(), parts.end(), [](const FoundPlane& a, const FoundPlane& b) {
    return a.members.size() > b.members.size();
  });
  return parts;
}

}  // namespace

size_t SplitPlanes(const PlaneOptions& options, double sigma_px, Reconstruction* model) {
  std::unordered_map<point3D_t, PlanePoint> eligible;
  for (PlanePoint& point : EligiblePoints(options, *model, ViewMap(*model), WhichPoints::kOnPlanes,
                                          sigma_px, nullptr)) {
    const point3D_t id = point.id;
    eligible.emplace(id, std::move(point));
  }
  std::vector<group3D_t> planes;
  for (const auto& [id, group] : model->groups3D) {
    if (IsPlane(*group.type)) planes.push_back(id);
  }
  size_t num_added = 0;
  for (const group3D_t id : planes) {
    const std::vector<point3D_t> members = model->groups3D.at(id).point3D_ids;
    std::vector<PlanePoint> known;
    std::vector<point3D_t> others;
    Eigen::Vector3d centre = Eigen::Vector3d::Zero();
    for (const point3D_t point_id : members) {
      const auto it = eligible.find(point_id);
      if (it == eligible.end()) {
        others.push_back(point_id);
      } else {
        known.push_back(it->second);
        centre += it->second.X;
      }
    }
    if (known.empty()) continue;
    centre /= static_cast<double>(known.size());
    for (PlanePoint& point : known) point.X -= centre;
    const PlanePoints points(options, std::move(known));
    const std::vector<FoundPlane> parts = PartsOf(options, points);
    if (parts.size() == 1) continue;
    std::vector<std::vector<point3D_t>> ids(parts.size());
    for (size_t k = 0; k < parts.size(); ++k) {
      for (const uint32_t i : parts[k].members) ids[k].push_back(points[i].id);
    }
    // Points of few images go to the plane that is nearest.
    for (const point3D_t other : others) {
      const Eigen::Vector3d X = model->points3D.at(other).xyz - centre;
      size_t nearest = 0;
      for (size_t k = 1; k < parts.size(); ++k) {
        if (std::abs(parts[k].params.Signed(X)) < std::abs(parts[nearest].params.Signed(X)))
          nearest = k;
      }
      ids[nearest].push_back(other);
    }
    const auto in_world = [&centre](const PlaneParams& p) {
      return std::vector<double>{p.n.x(), p.n.y(), p.n.z(), p.w - p.n.dot(centre)};
    };
    const std::vector<line3D_t> lines = model->groups3D.at(id).line3D_ids;
    for (const line3D_t line : lines) model->DeleteLineMember(id, line);
    for (const point3D_t point_id : members) model->DeletePointMember(id, point_id);
    for (const point3D_t point_id : ids[0]) model->AddPointMember(id, point_id);
    model->groups3D.at(id).params = in_world(parts[0].params);
    for (size_t k = 1; k < parts.size(); ++k) {
      model->AddGroup3D(PlaneType(), in_world(parts[k].params), ids[k]);
      ++num_added;
    }
  }
  return num_added;
}

}  // namespace holba
