// SPDX-License-Identifier: BSD-3-Clause
// Nearest neighbours among points in space.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <vector>

namespace holba {

class KdTree {
 public:
  struct Neighbour {
    uint32_t index = 0;  // into the points given
    double squared_distance = 0.0;
  };

  explicit KdTree(std::span<const Eigen::Vector3d> points);

  size_t size() const { return points_.size(); }
  // The k nearest points (all, if there are fewer), by distance, equal ones by index.
  std::vector<Neighbour> Nearest(const Eigen::Vector3d& x, size_t k) const;

 private:
  // Points of a leaf; beyond some tens the search of a leaf costs more than a step down.
  static constexpr size_t kLeafSize = 12;
  struct Node {
    uint32_t begin, end;  // in order_
    uint32_t right = 0;   // the left child follows its parent; 0: a leaf
    int axis = 0;
    double split = 0.0;
  };
  uint32_t Build(uint32_t begin, uint32_t end);
  void Search(uint32_t node, const Eigen::Vector3d& x, size_t k,
              std::vector<Neighbour>* heap) const;

  std::vector<Eigen::Vector3d> points_;  // in the order of the leaves
  std::vector<uint32_t> order_;
  std::vector<Node> nodes_;
};

}  // namespace holba
