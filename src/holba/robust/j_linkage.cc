// SPDX-License-Identifier: BSD-3-Clause
#include "holba/robust/j_linkage.h"

#include <algorithm>
#include <bit>
#include <limits>
#include <utility>

// Without this, portable x86-64 code counts bits by shifts and masks: five times slower.
#if defined(__x86_64__) && defined(__linux__) && defined(__GNUC__) && !defined(__clang__) && \
    !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
#define HOLBA_WITH_POPCOUNT __attribute__((target_clones("popcnt", "default")))
#else
#define HOLBA_WITH_POPCOUNT
#endif

namespace holba {
namespace {

constexpr size_t kNone = std::numeric_limits<size_t>::max();

HOLBA_WITH_POPCOUNT uint32_t CountCommon(const uint64_t* a, const uint64_t* b, size_t num_words) {
  uint32_t count = 0;
  for (size_t i = 0; i < num_words; ++i) count += std::popcount(a[i] & b[i]);
  return count;
}

// The same at the words that are listed: those where `a` has any bit.
HOLBA_WITH_POPCOUNT uint32_t CountCommonAt(const std::vector<uint32_t>& word_idxs,
                                           const uint64_t* a, const uint64_t* b) {
  uint32_t count = 0;
  for (const uint32_t i : word_idxs) count += std::popcount(a[i] & b[i]);
  return count;
}

double JaccardDistance(uint32_t num_common, uint32_t size1, uint32_t size2) {
  if (num_common == 0) return 1.0;
  return 1.0 - static_cast<double>(num_common) / (size1 + size2 - num_common);
}

// The distances of all pairs, and for each cluster its nearest among the clusters after it. Two
// clusters become one in the place of the first. The distance of a merged cluster to a third one
// may be less than both distances before (the intersection may resemble it more), so that chains of
// nearest neighbours would not give the same clusters: every step takes the least of all.
class Linkage {
 public:
  explicit Linkage(PreferenceSets sets)
      : sets_(std::move(sets)),
        n_(sets_.num_items()),
        distances_(n_ * n_, 1.0),
        sizes_(n_),
        members_(n_),
        nearest_(n_, kNone),
        least_(n_, 1.0) {
    for (size_t i = 0; i < n_; ++i) {
      members_[i] = {i};
      active_.push_back(i);
      sizes_[i] = CountCommon(sets_.Words(i), sets_.Words(i), sets_.words_per_item());
    }
    for (size_t i = 0; i < n_; ++i) {
      for (size_t j = i + 1; j < n_; ++j) {
        distances_[i * n_ + j] =
            JaccardDistance(CountCommon(sets_.Words(i), sets_.Words(j), sets_.words_per_item()),
                            sizes_[i], sizes_[j]);
      }
      FindNearest(i);
    }
  }

  std::vector<std::vector<size_t>> Run() {
    while (true) {
      size_t first = kNone;
      double least = 1.0;
      for (const size_t i : active_) {
        if (least_[i] < least) {
          least = least_[i];
          first = i;
        }
      }
      if (first == kNone) break;
      Merge(first, nearest_[first]);
    }
    std::vector<std::vector<size_t>> clusters;
    for (const size_t i : active_) {
      clusters.push_back(std::move(members_[i]));
      std::sort(clusters.back().begin(), clusters.back().end());
    }
    return clusters;
  }

 private:
  void FindNearest(size_t i) {
    nearest_[i] = kNone;
    least_[i] = 1.0;
    const auto after = std::upper_bound(active_.begin(), active_.end(), i);
    for (auto j = after; j != active_.end(); ++j) {
      if (distances_[i * n_ + *j] < least_[i]) {
        least_[i] = distances_[i * n_ + *j];
        nearest_[i] = *j;
      }
    }
  }

  void Merge(size_t a, size_t b) {
    members_[a].insert(members_[a].end(), members_[b].begin(), members_[b].end());
    members_[b].clear();
    active_.erase(std::lower_bound(active_.begin(), active_.end(), b));
    uint64_t* const words = sets_.Words(a);
    const uint64_t* const other = sets_.Words(b);
    word_idxs_.clear();
    sizes_[a] = 0;
    for (size_t i = 0; i < sets_.words_per_item(); ++i) {
      words[i] &= other[i];
      if (words[i] == 0) continue;
      word_idxs_.push_back(static_cast<uint32_t>(i));
      sizes_[a] += std::popcount(words[i]);
    }
    for (const size_t k : active_) {
      if (k == a) continue;
      const double distance =
          JaccardDistance(CountCommonAt(word_idxs_, words, sets_.Words(k)), sizes_[a], sizes_[k]);
      (k < a ? distances_[k * n_ + a] : distances_[a * n_ + k]) = distance;
      if (nearest_[k] == a || nearest_[k] == b) {
        FindNearest(k);
      } else if (k < a && (distance < least_[k] || (distance == least_[k] && a < nearest_[k]))) {
        if (distance < 1.0) {
          least_[k] = distance;
          nearest_[k] = a;
        }
      }
    }
    FindNearest(a);
  }

  PreferenceSets sets_;
  size_t n_;
  std::vector<double> distances_;  // row i, column j > i
  std::vector<uint32_t> sizes_;
  std::vector<std::vector<size_t>> members_;
  std::vector<size_t> active_;   // clusters that still stand, ascending
  std::vector<size_t> nearest_;  // kNone: all at distance 1
  std::vector<double> least_;
  std::vector<uint32_t> word_idxs_;  // of the merged set
};

}  // namespace

std::vector<std::vector<size_t>> ClusterByJLinkage(PreferenceSets sets) {
  return Linkage(std::move(sets)).Run();
}

}  // namespace holba
