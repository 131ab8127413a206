// SPDX-License-Identifier: BSD-3-Clause
#include "holba/linear/update_plan.h"

#include <algorithm>

namespace holba {

UpdatePlan PlanUpdateMemory(const Elimination& plan, const std::vector<int>& subtrees,
                            const std::vector<size_t>& sizes) {
  struct Hole {
    size_t begin, size;
    int reader;
  };
  const int num_supernodes = plan.num_supernodes();
  std::vector<int> subtree_of(num_supernodes, -1);
  for (int root : subtrees) {
    for (int s = plan.first_descendant[root]; s <= root; ++s) subtree_of[s] = root;
  }
  std::vector<std::vector<int>> children(num_supernodes);
  for (int s = 0; s < num_supernodes; ++s) {
    if (plan.parent[s] != -1) children[plan.parent[s]].push_back(s);
  }
  // Whether the front `reader` has been assembled for sure when front s begins.
  const auto is_before = [&](int reader, int s) {
    return reader < s && (reader >= plan.first_descendant[s] ||
                          (subtree_of[s] != -1 && subtree_of[s] == subtree_of[reader]));
  };
  UpdatePlan result;
  result.offset.resize(num_supernodes, 0);
  std::vector<Hole> holes;
  for (int s = 0; s < num_supernodes; ++s) {
    auto best = holes.end();
    for (auto hole = holes.begin(); hole != holes.end(); ++hole) {
      if (hole->size < sizes[s] || !is_before(hole->reader, s)) continue;
      if (best == holes.end() || hole->size < best->size) best = hole;
    }
    if (sizes[s] == 0) {
      // A root leaves nothing.
    } else if (best == holes.end()) {
      result.offset[s] = result.size;
      result.size += sizes[s];
    } else {
      result.offset[s] = best->begin;
      best->begin += sizes[s];
      best->size -= sizes[s];
      if (best->size == 0) holes.erase(best);
    }
    for (int child : children[s]) {
      if (sizes[child] == 0) continue;
      Hole freed{result.offset[child], sizes[child], s};
      // Holes side by side become one, read last by the later reader.
      for (auto hole = holes.begin(); hole != holes.end();) {
        const bool beside =
            hole->begin + hole->size == freed.begin || freed.begin + freed.size == hole->begin;
        if (beside && (hole->reader == s || is_before(hole->reader, s))) {
          freed.begin = std::min(freed.begin, hole->begin);
          freed.size += hole->size;
          hole = holes.erase(hole);
        } else {
          ++hole;
        }
      }
      holes.push_back(freed);
    }
  }
  return result;
}

}  // namespace holba
