// SPDX-License-Identifier: BSD-3-Clause
#include "holba/robust/kd_tree.h"

#include <algorithm>
#include <numeric>

namespace holba {
namespace {

bool IsNearer(const KdTree::Neighbour& a, const KdTree::Neighbour& b) {
  if (a.squared_distance != b.squared_distance) return a.squared_distance < b.squared_distance;
  return a.index < b.index;
}

}  // namespace

KdTree::KdTree(std::span<const Eigen::Vector3d> points)
    : points_(points.begin(), points.end()), order_(points.size()) {
  std::iota(order_.begin(), order_.end(), 0);
  if (points.empty()) return;
  nodes_.reserve(4 * points.size() / kLeafSize + 2);
  Build(0, static_cast<uint32_t>(points.size()));
  for (size_t i = 0; i < order_.size(); ++i) points_[i] = points[order_[i]];
}

uint32_t KdTree::Build(uint32_t begin, uint32_t end) {
  const uint32_t index = static_cast<uint32_t>(nodes_.size());
  nodes_.push_back({begin, end});
  if (end - begin <= kLeafSize) return index;
  Eigen::Array3d low = points_[order_[begin]].array(), high = low;
  for (uint32_t i = begin; i < end; ++i) {
    low = low.min(points_[order_[i]].array());
    high = high.max(points_[order_[i]].array());
  }
  int axis = 0;
  (high - low).maxCoeff(&axis);
  const uint32_t middle = begin + (end - begin) / 2;
  // Ties by index, so that the tree does not depend on the library's nth_element.
  std::nth_element(order_.begin() + begin, order_.begin() + middle, order_.begin() + end,
                   [&](uint32_t a, uint32_t b) {
                     const double xa = points_[a][axis], xb = points_[b][axis];
                     return xa != xb ? xa < xb : a < b;
                   });
  nodes_[index].axis = axis;
  nodes_[index].split = points_[order_[middle]][axis];
  Build(begin, middle);
  const uint32_t right = Build(middle, end);
  nodes_[index].right = right;
  return index;
}

std::vector<KdTree::Neighbour> KdTree::Nearest(const Eigen::Vector3d& x, size_t k) const {
  std::vector<Neighbour> heap;
  if (nodes_.empty() || k == 0) return heap;
  heap.reserve(std::min(k, size()) + 1);
  Search(0, x, k, &heap);
  std::sort_heap(heap.begin(), heap.end(), IsNearer);
  return heap;
}

void KdTree::Search(uint32_t node_index, const Eigen::Vector3d& x, size_t k,
                    std::vector<Neighbour>* heap) const {
  const Node& node = nodes_[node_index];
  if (node.right == 0) {
    for (uint32_t i = node.begin; i < node.end; ++i) {
      const Neighbour candidate{order_[i], (points_[i] - x).squaredNorm()};
      if (heap->size() == k) {
        if (!IsNearer(candidate, heap->front())) continue;
        std::pop_heap(heap->begin(), heap->end(), IsNearer);
        heap->back() = candidate;
      } else {
        heap->push_back(candidate);
      }
      std::push_heap(heap->begin(), heap->end(), IsNearer);
    }
    return;
  }
  const double beyond = x[node.axis] - node.split;
  Search(beyond < 0.0 ? node_index + 1 : node.right, x, k, heap);
  if (heap->size() == k && beyond * beyond > heap->front().squared_distance) return;
  Search(beyond < 0.0 ? node.right : node_index + 1, x, k, heap);
}

}  // namespace holba
