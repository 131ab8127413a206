// SPDX-License-Identifier: BSD-3-Clause
// Exact distances of many points from a mesh, a cloud or a set of edges: millions against millions
// in seconds. In the unit of the coordinates; the same bits for any number of threads.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "holba/evaluation/box_tree.h"

namespace holba {

// Squared distance of x from the triangle (its surface, edges and corners). One without area, or
// with as good as none (its height below 1e-8 of its length), is what it looks like: its edges.
double SquaredDistanceToTriangle(const Eigen::Vector3d& x, const Eigen::Vector3d& a,
                                 const Eigen::Vector3d& b, const Eigen::Vector3d& c);
// From the segment; from the point where both ends are one.
double SquaredDistanceToSegment(const Eigen::Vector3d& x, const Eigen::Vector3d& a,
                                const Eigen::Vector3d& b);

class NearestDistance {
 public:
  // Indices must be those of vertices.
  static NearestDistance ToTriangles(std::span<const Eigen::Vector3d> vertices,
                                     std::span<const std::array<uint32_t, 3>> triangles);
  static NearestDistance ToPoints(std::span<const Eigen::Vector3d> points);
  static NearestDistance ToSegments(std::span<const std::array<Eigen::Vector3d, 2>> segments);

  // How many triangles, points or segments there are.
  size_t size() const { return size_; }

  // Of one point; infinite if there is nothing to be near to.
  double Of(const Eigen::Vector3d& x) const;
  // Of each. Points that are near each other in the list are found faster: nothing has to be sorted
  // then (`is_sorted`).
  std::vector<double> Of(std::span<const Eigen::Vector3d> points, int num_threads,
                         bool is_sorted = false) const;
  // The nearest of the segments whose direction is within an angle (its cosine) of `direction`
  // (unit, unsigned). Empty: there is none.
  struct Segment {
    uint32_t index = 0;  // into the segments given
    double distance = 0.0;
  };
  std::optional<Segment> Along(const Eigen::Vector3d& x, const Eigen::Vector3d& direction,
                               double min_cosine) const;

 private:
  NearestDistance(int arity, size_t size, std::span<const Box3d> boxes)
      : arity_(arity), size_(size), tree_(boxes) {}
  // `bound`: what is as far or farther is not looked for, and then returned.
  double Squared(const Eigen::Vector3d& x, double bound) const;

  int arity_;  // corners of each thing: 1, 2 or 3
  size_t size_;
  BoxTree tree_;
  std::vector<Eigen::Vector3d> corners_;  // in the order of the tree's slots
};

}  // namespace holba
