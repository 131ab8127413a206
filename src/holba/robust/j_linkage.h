// SPDX-License-Identifier: BSD-3-Clause
// J-Linkage: clusters of items that agree with the same models (Toldo and Fusiello, Robust multiple
// structures estimation with J-Linkage, ECCV 2008). Knows bits only: which item agrees with which
// hypothesis is for the caller to say.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace holba {

// For each item the set of hypotheses that it agrees with.
class PreferenceSets {
 public:
  PreferenceSets(size_t num_items, size_t num_hypotheses)
      : num_items_(num_items),
        words_per_item_((num_hypotheses + 63) / 64),
        words_(num_items * words_per_item_, 0) {}

  size_t num_items() const { return num_items_; }
  size_t words_per_item() const { return words_per_item_; }
  uint64_t* Words(size_t item) { return words_.data() + item * words_per_item_; }
  const uint64_t* Words(size_t item) const { return words_.data() + item * words_per_item_; }
  void Insert(size_t item, size_t hypothesis) {
    Words(item)[hypothesis / 64] |= uint64_t{1} << (hypothesis % 64);
  }
  bool Contains(size_t item, size_t hypothesis) const {
    return (Words(item)[hypothesis / 64] >> (hypothesis % 64)) & 1;
  }

 private:
  size_t num_items_, words_per_item_;
  std::vector<uint64_t> words_;
};

// Clusters of items: starting from single ones, the two with the least Jaccard distance
// 1 - |A and B| / |A or B| of their sets become one, whose set is A and B, until no two sets have
// an element in common. Of equal distances the one with the first item in order counts. Returns
// the items of each cluster in ascending order, the clusters in the order of their first items;
// every item is in one.
//
// Quadratic in memory (8 bytes a pair) and in time with the number of items; each pair costs one
// popcount for 64 hypotheses, twice.
std::vector<std::vector<size_t>> ClusterByJLinkage(PreferenceSets sets);

}  // namespace holba
