// SPDX-License-Identifier: BSD-3-Clause
#include "holba/linear/elimination.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "holba/linear/linear_testing.h"
#include "holba/linear/reduced_solver.h"
#include "holba/linear/update_plan.h"

namespace holba {
namespace {

std::vector<BlockPattern> Patterns() {
  Random random(1);
  std::vector<int> mixed(60);
  for (int& w : mixed) w = 1 + static_cast<int>(random.Index(BlockPattern::kMaxWidth));
  return {
      MakePattern({3}, [](int, int) { return true; }),
      MakePattern(mixed, [](int, int) { return false; }),
      MakePattern(mixed, [](int a, int) { return a == 59; }),
      MakePattern(mixed, [](int a, int b) { return a - b <= 3; }),
      MakePattern(std::vector<int>(100, 6), [](int a, int b) { return a - b == 10 || a - b == 1; }),
      MakePattern(mixed, [&](int, int) { return random.Uniform() < 0.05; }),
      MakePattern(mixed, [&](int, int) { return random.Uniform() < 0.4; }),
      MakePattern(mixed, [](int, int) { return true; }),
  };
}

constexpr Ordering kOrderings[] = {Ordering::kBest, Ordering::kMinimumDegree,
                                   Ordering::kNestedDissection};

// Elimination node by node, written down as it is defined: flops, and each node's later neighbours.
struct Naive {
  double flops = 0.0;
  std::vector<std::set<int>> later;  // by position
};

Naive EliminateNaively(const BlockPattern& pattern, const std::vector<int>& node_at,
                       const std::vector<int>& position) {
  Naive naive;
  naive.later.resize(node_at.size());
  for (int a = 0; a < pattern.num_nodes(); ++a) {
    for (size_t k = pattern.row_start[a]; k + 1 < pattern.row_start[a + 1]; ++k) {
      const int p = position[a], q = position[pattern.column[k]];
      naive.later[std::min(p, q)].insert(std::max(p, q));
    }
  }
  for (size_t k = 0; k < node_at.size(); ++k) {
    const std::set<int>& reached = naive.later[k];
    double below = 0.0;
    for (const int p : reached) below += pattern.widths[node_at[p]];
    const double w = pattern.widths[node_at[k]];
    naive.flops += w * w * w / 3.0 + w * w * below + w * below * below;
    if (reached.empty()) continue;
    const int parent = *reached.begin();
    for (const int p : reached) {
      if (p != parent) naive.later[parent].insert(p);
    }
  }
  return naive;
}

TEST(PlanElimination, EveryNodeHasOnePositionAndChildrenComeBeforeParents) {
  for (const BlockPattern& pattern : Patterns()) {
    for (const Ordering ordering : kOrderings) {
      const auto plan = PlanElimination(pattern, ordering);
      std::vector<int> sorted = plan->node_at;
      std::sort(sorted.begin(), sorted.end());
      for (int i = 0; i < pattern.num_nodes(); ++i) {
        EXPECT_EQ(sorted[i], i);
        EXPECT_EQ(plan->position[plan->node_at[i]], i);
      }
      EXPECT_EQ(plan->begin.back(), pattern.num_nodes());
      for (int s = 0; s < plan->num_supernodes(); ++s) {
        EXPECT_LT(plan->begin[s], plan->begin[s + 1]);
        if (plan->parent[s] == -1) continue;
        EXPECT_GT(plan->parent[s], s);
        EXPECT_LE(plan->first_descendant[plan->parent[s]], plan->first_descendant[s]);
      }
    }
  }
}

TEST(PlanElimination, FrontsHoldEveryEntryOfTheFactorAndHandTheirRowsToTheirParents) {
  for (const BlockPattern& pattern : Patterns()) {
    for (const Ordering ordering : kOrderings) {
      const auto plan = PlanElimination(pattern, ordering);
      const Naive naive = EliminateNaively(pattern, plan->node_at, plan->position);
      for (int s = 0; s < plan->num_supernodes(); ++s) {
        const std::set<int> rows(plan->row.begin() + plan->row_begin[s],
                                 plan->row.begin() + plan->row_begin[s + 1]);
        for (int k = plan->begin[s]; k < plan->begin[s + 1]; ++k) {
          for (const int p : naive.later[k]) {
            EXPECT_TRUE(p < plan->begin[s + 1] || rows.count(p) == 1);
          }
        }
        const int parent = plan->parent[s];
        EXPECT_EQ(parent == -1, rows.empty());
        for (const int p : rows) {
          const auto begin = plan->row.begin() + plan->row_begin[parent];
          const auto end = plan->row.begin() + plan->row_begin[parent + 1];
          EXPECT_TRUE((p >= plan->begin[parent] && p < plan->begin[parent + 1]) ||
                      std::binary_search(begin, end, p));
        }
      }
    }
  }
}

TEST(PlanElimination, PredictedFlopsAreThoseOfEliminationNodeByNode) {
  for (const BlockPattern& pattern : Patterns()) {
    for (const Ordering ordering : kOrderings) {
      const auto plan = PlanElimination(pattern, ordering);
      const Naive naive = EliminateNaively(pattern, plan->node_at, plan->position);
      // Merged fronts change the order among nodes without changing the factor by much.
      EXPECT_NEAR(plan->flops, naive.flops, 1e-9 * naive.flops);
    }
  }
}

TEST(PlanUpdateMemory, NoTwoUpdatesThatMayLiveAtOnceShareMemory) {
  for (const BlockPattern& pattern : Patterns()) {
    for (const Ordering ordering : kOrderings) {
      const auto plan = PlanElimination(pattern, ordering);
      const int n = plan->num_supernodes();
      std::vector<size_t> sizes(n);
      for (int s = 0; s < n; ++s) {
        sizes[s] = 10 * (plan->row_begin[s + 1] - plan->row_begin[s]) + (s % 3);
      }
      // Subtrees of up to 4 fronts at once, the fronts above them after their children.
      std::vector<int> subtrees, subtree_of(n, -1);
      for (int s = n - 1; s >= 0; --s) {
        if (subtree_of[s] != -1 || s - plan->first_descendant[s] >= 4) continue;
        subtrees.push_back(s);
        for (int t = plan->first_descendant[s]; t <= s; ++t) subtree_of[t] = s;
      }
      const UpdatePlan updates = PlanUpdateMemory(*plan, subtrees, sizes);
      const auto comes_before = [&](int s, int t) {  // s is done when t begins
        return s < t && (s >= plan->first_descendant[t] ||
                         (subtree_of[s] != -1 && subtree_of[s] == subtree_of[t]));
      };
      for (int s = 0; s < n; ++s) {
        EXPECT_LE(updates.offset[s] + sizes[s], updates.size);
        for (int t = 0; t < n; ++t) {
          if (s == t || updates.offset[s] + sizes[s] <= updates.offset[t] ||
              updates.offset[t] + sizes[t] <= updates.offset[s]) {
            continue;
          }
          const int first = std::min(s, t), second = std::max(s, t);
          const int reader = plan->parent[first];
          EXPECT_TRUE(sizes[s] == 0 || sizes[t] == 0 ||
                      (reader != -1 && comes_before(reader, second)))
              << s << " and " << t;
        }
      }
    }
  }
}

TEST(PredictFlops, AFullPatternIsAsMuchWorkSparseAsDense) {
  const BlockPattern pattern = MakePattern(std::vector<int>(30, 6), [](int, int) { return true; });
  EXPECT_NEAR(PredictSparseFlops(pattern), PredictDenseFlops(pattern), 1.0);
  const auto solver = MakeSparseSolver(pattern, Precision::kDouble, 1);
  EXPECT_GE(solver->FactorFlops(), PredictSparseFlops(pattern));
}

TEST(PredictFlops, AnArrowNeedsNoFill) {
  const int n = 100;
  const BlockPattern pattern =
      MakePattern(std::vector<int>(n, 6), [](int, int b) { return b == 0; });
  const double leaf = 6.0 * 6.0 * 6.0 * (1.0 / 3.0 + 2.0);
  EXPECT_NEAR(PredictSparseFlops(pattern), (n - 1) * leaf + 72.0, 1e-6);
}

}  // namespace
}  // namespace holba
