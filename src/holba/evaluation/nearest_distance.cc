// SPDX-License-Identifier: BSD-3-Clause
#include "holba/evaluation/nearest_distance.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "holba/base/check.h"
#include "holba/base/threads.h"

namespace holba {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
// Height of a triangle, as a part of its longest edge, from which on its plane is trusted: the
// normal of a flatter one is off by more than rounding / 1e-8 = 1e-8 radians.
constexpr double kMinFlatness = 1e-8;
// Points that one thread takes at a time, each with the distance of the one before as a first
// guess. Fixed, so that the bits do not depend on the number of threads.
constexpr size_t kChunk = 512;

// Interleaved bits of a position in a grid of 2^21 cells a side.
uint64_t MortonCode(const Eigen::Vector3d& x, const Box3d& box) {
  uint64_t code = 0;
  for (int axis = 0; axis < 3; ++axis) {
    const double extent = box.high[axis] - box.low[axis];
    const double part = extent > 0.0 ? (x[axis] - box.low[axis]) / extent : 0.0;
    uint64_t cell = static_cast<uint64_t>(std::clamp(part, 0.0, 1.0) * 2097151.0);
    cell = (cell | cell << 32) & 0x1f00000000ffffULL;
    cell = (cell | cell << 16) & 0x1f0000ff0000ffULL;
    cell = (cell | cell << 8) & 0x100f00f00f00f00fULL;
    cell = (cell | cell << 4) & 0x10c30c30c30c30c3ULL;
    cell = (cell | cell << 2) & 0x1249249249249249ULL;
    code |= cell << axis;
  }
  return code;
}

std::vector<uint32_t> SortedInSpace(std::span<const Eigen::Vector3d> points) {
  Box3d box;
  for (const Eigen::Vector3d& x : points) box.Extend(x);
  std::vector<std::pair<uint64_t, uint32_t>> codes(points.size());
  for (size_t i = 0; i < points.size(); ++i) {
    codes[i] = {MortonCode(points[i], box), static_cast<uint32_t>(i)};
  }
  std::sort(codes.begin(), codes.end());
  std::vector<uint32_t> order(points.size());
  for (size_t i = 0; i < codes.size(); ++i) order[i] = codes[i].second;
  return order;
}

}  // namespace

double SquaredDistanceToSegment(const Eigen::Vector3d& x, const Eigen::Vector3d& a,
                                const Eigen::Vector3d& b) {
  const Eigen::Vector3d along = b - a, from_a = x - a;
  const double length2 = along.squaredNorm(), t = from_a.dot(along);
  if (!(t > 0.0)) return from_a.squaredNorm();
  if (!(t < length2)) return (x - b).squaredNorm();
  return (from_a - (t / length2) * along).squaredNorm();
}

double SquaredDistanceToTriangle(const Eigen::Vector3d& x, const Eigen::Vector3d& a,
                                 const Eigen::Vector3d& b, const Eigen::Vector3d& c) {
  const Eigen::Vector3d ab = b - a, bc = c - b, ca = a - c;
  const Eigen::Vector3d normal = ab.cross(-ca);
  const double normal2 = normal.squaredNorm();
  const double length2 = std::max({ab.squaredNorm(), bc.squaredNorm(), ca.squaredNorm()});
  if (normal2 > kMinFlatness * kMinFlatness * length2 * length2) {
    const Eigen::Vector3d from_a = x - a;
    if (normal.cross(ab).dot(from_a) >= 0.0 && normal.cross(bc).dot(x - b) >= 0.0 &&
        normal.cross(ca).dot(x - c) >= 0.0) {
      const double height = normal.dot(from_a);
      return height * height / normal2;
    }
  }
  return std::min({SquaredDistanceToSegment(x, a, b), SquaredDistanceToSegment(x, b, c),
                   SquaredDistanceToSegment(x, c, a)});
}

NearestDistance NearestDistance::ToTriangles(std::span<const Eigen::Vector3d> vertices,
                                             std::span<const std::array<uint32_t, 3>> triangles) {
  std::vector<Box3d> boxes(triangles.size());
  for (size_t i = 0; i < triangles.size(); ++i) {
    for (const uint32_t corner : triangles[i]) {
      HOLBA_CHECK(corner < vertices.size());
      boxes[i].Extend(vertices[corner]);
    }
  }
  NearestDistance distance(3, triangles.size(), boxes);
  distance.corners_.reserve(3 * triangles.size());
  for (const uint32_t i : distance.tree_.order()) {
    for (const uint32_t corner : triangles[i]) distance.corners_.push_back(vertices[corner]);
  }
  return distance;
}

NearestDistance NearestDistance::ToPoints(std::span<const Eigen::Vector3d> points) {
  std::vector<Box3d> boxes(points.size());
  for (size_t i = 0; i < points.size(); ++i) boxes[i].Extend(points[i]);
  NearestDistance distance(1, points.size(), boxes);
  distance.corners_.reserve(points.size());
  for (const uint32_t i : distance.tree_.order()) distance.corners_.push_back(points[i]);
  return distance;
}

NearestDistance NearestDistance::ToSegments(
    std::span<const std::array<Eigen::Vector3d, 2>> segments) {
  std::vector<Box3d> boxes(segments.size());
  for (size_t i = 0; i < segments.size(); ++i) {
    for (const Eigen::Vector3d& end : segments[i]) boxes[i].Extend(end);
  }
  NearestDistance distance(2, segments.size(), boxes);
  distance.corners_.reserve(2 * segments.size());
  for (const uint32_t i : distance.tree_.order()) {
    for (const Eigen::Vector3d& end : segments[i]) distance.corners_.push_back(end);
  }
  return distance;
}

double NearestDistance::Squared(const Eigen::Vector3d& x, double bound) const {
  const Eigen::Vector3d* corners = corners_.data();
  switch (arity_) {
    case 1:
      return tree_.Nearest(x, bound,
                           [&](uint32_t slot) { return (x - corners[slot]).squaredNorm(); });
    case 2:
      return tree_.Nearest(x, bound, [&](uint32_t slot) {
        return SquaredDistanceToSegment(x, corners[2 * slot], corners[2 * slot + 1]);
      });
    default:
      return tree_.Nearest(x, bound, [&](uint32_t slot) {
        const Eigen::Vector3d* corner = corners + 3 * slot;
        return SquaredDistanceToTriangle(x, corner[0], corner[1], corner[2]);
      });
  }
}

double NearestDistance::Of(const Eigen::Vector3d& x) const {
  return std::sqrt(Squared(x, kInfinity));
}

std::vector<double> NearestDistance::Of(std::span<const Eigen::Vector3d> points, int num_threads,
                                        bool is_sorted) const {
  std::vector<double> distances(points.size(), kInfinity);
  if (size_ == 0) return distances;
  const std::vector<uint32_t> order = is_sorted ? std::vector<uint32_t>() : SortedInSpace(points);
  const size_t num_chunks = (points.size() + kChunk - 1) / kChunk;
  ParallelTasks(num_threads, num_chunks, [&](size_t chunk) {
    double last_distance = kInfinity;
    const Eigen::Vector3d* last = nullptr;
    const size_t end = std::min(points.size(), (chunk + 1) * kChunk);
    for (size_t k = chunk * kChunk; k < end; ++k) {
      const size_t i = is_sorted ? k : order[k];
      const Eigen::Vector3d& x = points[i];
      // What is nearest to the last point is no farther than this from the present one; the factor
      // leaves room for rounding.
      double bound = kInfinity;
      if (last != nullptr) {
        const double reach = (last_distance + (x - *last).norm()) * (1.0 + 1e-9);
        bound = reach * reach;
      }
      double squared = Squared(x, bound);
      if (!(squared < bound)) squared = Squared(x, kInfinity);
      last = &x;
      last_distance = distances[i] = std::sqrt(squared);
    }
  });
  return distances;
}

std::optional<NearestDistance::Segment> NearestDistance::Along(const Eigen::Vector3d& x,
                                                               const Eigen::Vector3d& direction,
                                                               double min_cosine) const {
  HOLBA_CHECK(arity_ == 2);
  const Eigen::Vector3d* corners = corners_.data();
  double least = kInfinity;
  uint32_t least_slot = 0;
  tree_.Nearest(x, kInfinity, [&](uint32_t slot) {
    const Eigen::Vector3d along = corners[2 * slot + 1] - corners[2 * slot];
    if (!(std::abs(along.dot(direction)) >= min_cosine * along.norm())) return kInfinity;
    const double squared = SquaredDistanceToSegment(x, corners[2 * slot], corners[2 * slot + 1]);
    if (squared < least) {
      least = squared;
      least_slot = slot;
    }
    return squared;
  });
  if (!std::isfinite(least)) return std::nullopt;
  return Segment{tree_.order()[least_slot], std::sqrt(least)};
}

}  // namespace holba
