// SPDX-License-Identifier: BSD-3-Clause
#include "holba/synthetic/synthetic_associations.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <string>
#include <unordered_set>

#include "holba/base/check.h"
#include "holba/base/error.h"
#include "holba/geometry/line.h"

namespace holba {
namespace {

// How many of the next `size` associations are replaced, so that after any number of calls
// round(fraction * sum of sizes) are.
class EvenRounding {
 public:
  explicit EvenRounding(double fraction) : fraction_(fraction) {}
  size_t Next(size_t size) {
    total_ += size;
    const size_t before = done_;
    done_ = static_cast<size_t>(std::llround(fraction_ * static_cast<double>(total_)));
    return done_ - before;
  }

 private:
  const double fraction_;
  size_t total_ = 0, done_ = 0;
};

// `count` features out of `num_features` that are not in `right`: any, or those of least distance.
std::vector<uint32_t> WrongFeatures(size_t count, size_t num_features,
                                    const std::vector<uint32_t>& right, WrongAssociations kind,
                                    const std::function<double(uint32_t)>& distance,
                                    Random* random) {
  if (count + right.size() > num_features) {
    throw InputError(
        "--fraction_wrong_associations: a group has too few features that are not its members; use "
        "a smaller fraction or more images");
  }
  std::unordered_set<uint32_t> excluded(right.begin(), right.end());
  std::vector<uint32_t> wrong;
  if (kind == WrongAssociations::kRandom) {
    while (wrong.size() < count) {
      const uint32_t feature = static_cast<uint32_t>(random->Index(num_features));
      if (excluded.insert(feature).second) wrong.push_back(feature);
    }
    return wrong;
  }
  // A heap of the nearest ones, the farthest of them on top.
  std::vector<std::pair<double, uint32_t>> heap;
  for (uint32_t feature = 0; count > 0 && feature < num_features; ++feature) {
    if (excluded.contains(feature)) continue;
    const std::pair entry(distance(feature), feature);
    if (heap.size() == count) {
      if (entry > heap.front()) continue;
      std::pop_heap(heap.begin(), heap.end());
      heap.pop_back();
    }
    heap.push_back(entry);
    std::push_heap(heap.begin(), heap.end());
  }
  std::sort_heap(heap.begin(), heap.end());
  for (const auto& [d, feature] : heap) wrong.push_back(feature);
  return wrong;
}

void ReplaceSome(const std::vector<uint32_t>& wrong, Random* random,
                 std::vector<uint32_t>* members) {
  // The first wrong.size() places of a random permutation.
  std::vector<size_t> places(members->size());
  for (size_t i = 0; i < places.size(); ++i) places[i] = i;
  for (size_t i = 0; i < wrong.size(); ++i) {
    std::swap(places[i], places[i + random->Index(places.size() - i)]);
    (*members)[places[i]] = wrong[i];
  }
}

double DistanceToSegment(const Eigen::Vector3d& X, const Segment3d& segment) {
  const Eigen::Vector3d along = segment[1] - segment[0];
  const double t = std::clamp(along.dot(X - segment[0]) / along.squaredNorm(), 0.0, 1.0);
  return (segment[0] + t * along - X).norm();
}

void ReplaceMembers(double fraction, WrongAssociations kind, Random* random,
                    SyntheticStructure* structure) {
  EvenRounding num_points(fraction), num_lines(fraction);
  for (SyntheticGroup& group : structure->groups) {
    const GroupType& type = *group.type;
    std::array<double, kMaxGroupParams> g{};
    HOLBA_CHECK(type.from_file(group.params.data(), g.data()));
    const auto point_distance = [&](const Eigen::Vector3d& X) {
      Eigen::Vector3d projected;
      if (!type.project_point(g.data(), X, &projected)) {
        return std::numeric_limits<double>::infinity();
      }
      return (projected - X).norm();
    };
    const auto line_distance = [&](uint32_t line) {
      const Segment3d& segment = structure->segments[line];
      if (!type.IsParallelism()) {
        return std::max(point_distance(segment[0]), point_distance(segment[1]));
      }
      Eigen::Vector3d direction;
      type.direction(g.data(), &direction, nullptr);
      return (segment[1] - segment[0]).normalized().cross(direction).norm();
    };
    const auto wrong_points = WrongFeatures(
        num_points.Next(group.points.size()), structure->points.size(), group.points, kind,
        [&](uint32_t p) { return point_distance(structure->points[p]); }, random);
    const auto wrong_lines =
        WrongFeatures(num_lines.Next(group.lines.size()), structure->segments.size(), group.lines,
                      kind, line_distance, random);
    ReplaceSome(wrong_points, random, &group.points);
    ReplaceSome(wrong_lines, random, &group.lines);
  }
}

void ReplaceEdges(double fraction, WrongAssociations kind, Random* random,
                  SyntheticStructure* structure) {
  EvenRounding num_edges(fraction);
  std::vector<std::vector<uint32_t>> points_of_line(structure->segments.size());
  for (const SyntheticEdge& edge : structure->edges)
    points_of_line[edge.line].push_back(edge.point);
  std::vector<SyntheticEdge> edges;
  for (uint32_t line = 0; line < points_of_line.size(); ++line) {
    std::vector<uint32_t>& points = points_of_line[line];
    const auto wrong = WrongFeatures(
        num_edges.Next(points.size()), structure->points.size(), points, kind,
        [&](uint32_t p) {
          return DistanceToSegment(structure->points[p], structure->segments[line]);
        },
        random);
    ReplaceSome(wrong, random, &points);
    for (const uint32_t point : points) edges.push_back({point, line});
  }
  structure->edges = std::move(edges);
}

}  // namespace

void ReplaceAssociations(double fraction, WrongAssociations kind, Random* random,
                         SyntheticStructure* structure) {
  if (fraction <= 0) return;
  ReplaceMembers(fraction, kind, random, structure);
  ReplaceEdges(fraction, kind, random, structure);
}

}  // namespace holba
