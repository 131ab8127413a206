// SPDX-License-Identifier: BSD-3-Clause
// Sets of 0 ... size - 1 that are joined two at a time, each known by one of its elements, the
// root. Tarjan, "Efficiency of a good but not linear set union algorithm", 1975; paths are halved.
#pragma once

#include <cstddef>
#include <cstdint>
#include <numeric>
#include <vector>

namespace holba {

class UnionFind {
 public:
  // Each element is a set.
  explicit UnionFind(size_t size) : parent_(size) { std::iota(parent_.begin(), parent_.end(), 0u); }

  uint32_t Root(uint32_t i) {
    while (parent_[i] != i) i = parent_[i] = parent_[parent_[i]];
    return i;
  }

  // The set of `from` becomes a part of that of `into`, whose root is the root of both.
  void Join(uint32_t into, uint32_t from) { parent_[Root(from)] = Root(into); }

 private:
  std::vector<uint32_t> parent_;
};

}  // namespace holba
