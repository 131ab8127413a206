// SPDX-License-Identifier: BSD-3-Clause
#include "holba/evaluation/box_tree.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "holba/base/check.h"

namespace holba {
namespace {

double HalfArea(const Box3d& box) {
  const Eigen::Vector3d d = box.high - box.low;
  if (!(d.minCoeff() >= 0.0)) return 0.0;  // an empty box
  return d.x() * d.y() + d.y() * d.z() + d.z() * d.x();
}

}  // namespace

struct BoxTree::Builder {
  struct Range {
    uint32_t begin, end;
    Box3d box, centres;
  };

  std::span<const Box3d> boxes;
  BoxTree* tree;
  std::vector<Eigen::Vector3d> centre;  // of each thing

  Range RangeOf(uint32_t begin, uint32_t end) const {
    Range range{begin, end, {}, {}};
    for (uint32_t slot = begin; slot < end; ++slot) {
      range.box.Extend(boxes[tree->order_[slot]]);
      range.centres.Extend(centre[tree->order_[slot]]);
    }
    return range;
  }

  int BinOf(double position, double low, double scale) const {
    return std::clamp(static_cast<int>((position - low) * scale), 0, kNumBins - 1);
  }

  // Sorts the range's slots into two parts and returns where the second begins. Things whose
  // centres coincide, and those of a tree that has become too deep, are cut in the middle.
  uint32_t Split(const Range& range, int depth) {
    const uint32_t middle = range.begin + (range.end - range.begin) / 2;
    double best_cost = std::numeric_limits<double>::infinity();
    int best_axis = -1, best_bin = 0;
    for (int axis = 0; axis < 3 && depth < kMaxDepth; ++axis) {
      const double low = range.centres.low[axis], extent = range.centres.high[axis] - low;
      if (!(extent > 0.0) || !std::isfinite(kNumBins / extent)) continue;
      const double scale = kNumBins / extent;
      std::array<Box3d, kNumBins> box;
      std::array<uint32_t, kNumBins> count{};
      for (uint32_t slot = range.begin; slot < range.end; ++slot) {
        const uint32_t thing = tree->order_[slot];
        const int bin = BinOf(centre[thing][axis], low, scale);
        box[bin].Extend(boxes[thing]);
        ++count[bin];
      }
      std::array<double, kNumBins> cost_right{};  // of the bins from this one on
      Box3d right;
      uint32_t num_right = 0;
      for (int bin = kNumBins - 1; bin > 0; --bin) {
        right.Extend(box[bin]);
        num_right += count[bin];
        cost_right[bin] = HalfArea(right) * num_right;
      }
      Box3d left;
      uint32_t num_left = 0;
      for (int bin = 1; bin < kNumBins; ++bin) {
        left.Extend(box[bin - 1]);
        num_left += count[bin - 1];
        const double cost = HalfArea(left) * num_left + cost_right[bin];
        if (num_left > 0 && num_left < range.end - range.begin && cost < best_cost) {
          best_cost = cost;
          best_axis = axis;
          best_bin = bin;
        }
      }
    }
    const auto begin = tree->order_.begin() + range.begin, end = tree->order_.begin() + range.end;
    if (best_axis < 0) {
      int axis;
      (range.centres.high - range.centres.low).maxCoeff(&axis);
      std::nth_element(begin, tree->order_.begin() + middle, end, [&](uint32_t a, uint32_t b) {
        return std::make_pair(centre[a][axis], a) < std::make_pair(centre[b][axis], b);
      });
      return middle;
    }
    const double low = range.centres.low[best_axis];
    const double scale = kNumBins / (range.centres.high[best_axis] - low);
    const auto second = std::stable_partition(begin, end, [&](uint32_t thing) {
      return BinOf(centre[thing][best_axis], low, scale) < best_bin;
    });
    return static_cast<uint32_t>(second - tree->order_.begin());
  }

  void SetChild(const Range& range, int child, Node* node) const {
    const float infinity = std::numeric_limits<float>::infinity();
    for (int i = 0; i < 3; ++i) {
      if (range.begin == range.end) {  // of a tree of one thing: near to nothing
        node->low[child][i] = infinity;
        node->high[child][i] = -infinity;
        continue;
      }
      const double low = range.box.low[i] - tree->origin_[i];
      const double high = range.box.high[i] - tree->origin_[i];
      node->low[child][i] = std::nextafter(static_cast<float>(low), -infinity);
      node->high[child][i] = std::nextafter(static_cast<float>(high), infinity);
    }
    node->first[child] = range.begin;
    node->count[child] = range.end - range.begin;
  }

  void Build() {
    struct Task {
      uint32_t begin, end;
      uint32_t parent;  // the node whose child this is
      int child, depth;
    };
    constexpr uint32_t kNoParent = std::numeric_limits<uint32_t>::max();
    std::vector<Task> tasks{{0, static_cast<uint32_t>(boxes.size()), kNoParent, 0, 0}};
    while (!tasks.empty()) {
      const Task task = tasks.back();
      tasks.pop_back();
      const uint32_t id = static_cast<uint32_t>(tree->nodes_.size());
      if (task.parent != kNoParent) {
        Node& parent = tree->nodes_[task.parent];
        parent.first[task.child] = id;
        parent.count[task.child] = 0;
      }
      const Range range = RangeOf(task.begin, task.end);
      const uint32_t middle = Split(range, task.depth);
      Node node;
      const Range parts[2] = {RangeOf(task.begin, middle), RangeOf(middle, task.end)};
      for (int child = 0; child < 2; ++child) SetChild(parts[child], child, &node);
      tree->nodes_.push_back(node);
      for (int child = 1; child >= 0; --child) {
        if (node.count[child] > kLeafSize) {
          tasks.push_back({parts[child].begin, parts[child].end, id, child, task.depth + 1});
        }
      }
    }
  }
};

BoxTree::BoxTree(std::span<const Box3d> boxes) {
  HOLBA_CHECK(boxes.size() < (size_t{1} << 31));
  order_.resize(boxes.size());
  std::iota(order_.begin(), order_.end(), 0u);
  if (boxes.empty()) return;
  Builder builder{boxes, this, {}};
  builder.centre.reserve(boxes.size());
  Box3d all;
  for (const Box3d& box : boxes) {
    all.Extend(box);
    builder.centre.push_back(0.5 * (box.low + box.high));
  }
  HOLBA_CHECK(all.low.allFinite() && all.high.allFinite());
  origin_ = 0.5 * (all.low + all.high);
  nodes_.reserve(boxes.size() / 2 + 1);
  builder.Build();
  nodes_.shrink_to_fit();
}

}  // namespace holba
