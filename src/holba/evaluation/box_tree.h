// SPDX-License-Identifier: BSD-3-Clause
// A hierarchy of boxes over many small things in space, for what lies nearest to a point and for
// all that lies near one. It knows boxes only; the things are the caller's, in the order that the
// tree gives them. Split by the surface area heuristic over bins of centres (Wald, "On fast
// construction of SAH-based bounding volume hierarchies", 2007).
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

namespace holba {

struct Box3d {
  Eigen::Vector3d low = Eigen::Vector3d::Constant(std::numeric_limits<double>::infinity());
  Eigen::Vector3d high = Eigen::Vector3d::Constant(-std::numeric_limits<double>::infinity());

  void Extend(const Eigen::Vector3d& x) {
    low = low.cwiseMin(x);
    high = high.cwiseMax(x);
  }
  void Extend(const Box3d& box) {
    low = low.cwiseMin(box.low);
    high = high.cwiseMax(box.high);
  }
};

class BoxTree {
 public:
  // At most 2^31 boxes, all finite.
  explicit BoxTree(std::span<const Box3d> boxes);

  // Thing of each slot. Things of a leaf have slots in a row: a caller that sorts its things so
  // reads memory in order.
  const std::vector<uint32_t>& order() const { return order_; }

  // The smallest squared_distance(slot) below `bound`, else `bound`. squared_distance may not be
  // smaller than the squared distance of x from the slot's box.
  template <typename SquaredDistance>
  double Nearest(const Eigen::Vector3d& x, double bound,
                 const SquaredDistance& squared_distance) const;

  // Calls visit(slot) for everything whose box is within `radius` of x, and for some beyond.
  template <typename Visit>
  void ForEachNear(const Eigen::Vector3d& x, double radius, const Visit& visit) const;

 private:
  // Costs of a test of a thing and of a step down are alike; leaves of this size are split no more.
  static constexpr uint32_t kLeafSize = 4;
  static constexpr int kNumBins = 16;
  // The depth of a balanced tree of 2^31 things, and as much again: from kMaxDepth on nodes are cut
  // in half, so that the stack of a search has a bound.
  static constexpr int kMaxDepth = 64, kStackSize = kMaxDepth + 40;

  // A node holds the boxes of its two children, so that a step down touches one line of the cache.
  // Single precision about the tree's origin, rounded outward.
  struct Node {
    float low[2][3], high[2][3];
    uint32_t first[2];  // of an inner child: its node; of a leaf: its first slot
    uint32_t count[2];  // things of a leaf; 0: an inner child
  };
  struct Builder;

  static double SquaredDistance(const Node& node, int child, const Eigen::Vector3d& x) {
    double sum = 0.0;
    for (int i = 0; i < 3; ++i) {
      const double below = node.low[child][i] - x[i], above = x[i] - node.high[child][i];
      const double off = below > above ? below : above;
      sum += off > 0.0 ? off * off : 0.0;
    }
    return sum;
  }

  std::vector<uint32_t> order_;
  std::vector<Node> nodes_;
  Eigen::Vector3d origin_ = Eigen::Vector3d::Zero();
};

template <typename SquaredDistanceOf>
double BoxTree::Nearest(const Eigen::Vector3d& x, double bound,
                        const SquaredDistanceOf& squared_distance) const {
  if (nodes_.empty()) return bound;
  const Eigen::Vector3d x_about_origin = x - origin_;
  struct Entry {
    uint32_t node;
    double squared;
  };
  std::array<Entry, kStackSize> stack;
  int size = 0;
  stack[size++] = {0, 0.0};
  while (size > 0) {
    const Entry entry = stack[--size];
    if (!(entry.squared < bound)) continue;
    const Node& node = nodes_[entry.node];
    const double squared[2] = {SquaredDistance(node, 0, x_about_origin),
                               SquaredDistance(node, 1, x_about_origin)};
    const int near = squared[1] < squared[0] ? 1 : 0;
    // Leaves are looked at when they are met, inner children later: the near one first.
    for (const int child : {near, 1 - near}) {
      if (node.count[child] == 0 || !(squared[child] < bound)) continue;
      for (uint32_t i = 0; i < node.count[child]; ++i) {
        const double found = squared_distance(node.first[child] + i);
        if (found < bound) bound = found;
      }
    }
    for (const int child : {1 - near, near}) {
      if (node.count[child] == 0 && squared[child] < bound) {
        stack[size++] = {node.first[child], squared[child]};
      }
    }
  }
  return bound;
}

template <typename Visit>
void BoxTree::ForEachNear(const Eigen::Vector3d& x, double radius, const Visit& visit) const {
  if (nodes_.empty()) return;
  const Eigen::Vector3d x_about_origin = x - origin_;
  std::array<uint32_t, kStackSize> stack;
  int size = 0;
  stack[size++] = 0;
  while (size > 0) {
    const Node& node = nodes_[stack[--size]];
    for (int child = 0; child < 2; ++child) {
      if (!(SquaredDistance(node, child, x_about_origin) <= radius * radius)) continue;
      if (node.count[child] == 0) {
        stack[size++] = node.first[child];
      } else {
        for (uint32_t i = 0; i < node.count[child]; ++i) visit(node.first[child] + i);
      }
    }
  }
}

}  // namespace holba
