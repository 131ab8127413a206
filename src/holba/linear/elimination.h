// SPDX-License-Identifier: BSD-3-Clause
// Symbolic analysis of sparse Cholesky on the graph of nodes: in which order nodes are eliminated,
// which ones together (as one front), and which later nodes each front reaches.
#pragma once

#include <memory>
#include <vector>

#include "holba/linear/block_matrix.h"

namespace holba {

// Supernodes are numbered so that children come before parents and a subtree is a range.
struct Elimination {
  std::vector<int> node_at;   // node at each position of the order
  std::vector<int> position;  // of each node
  std::vector<int> begin;     // supernode s holds the positions begin[s] .. begin[s + 1] - 1
  std::vector<int> parent;    // supernode, greater than s; -1: a root
  std::vector<int> first_descendant;  // the subtree of s is first_descendant[s] .. s
  std::vector<size_t> row_begin;  // row[row_begin[s]] .. row[row_begin[s + 1] - 1]: positions that
  std::vector<int> row;           // s reaches, ascending, all past its own
  double flops = 0.0;             // without zeros stored in excess

  int num_supernodes() const { return static_cast<int>(parent.size()); }
};

enum class Ordering { kBest, kMinimumDegree, kNestedDissection };

// kBest: approximate minimum degree, or nested dissection where that needs fewer operations and
// these are enough to repay the search.
std::shared_ptr<const Elimination> PlanElimination(const BlockPattern& pattern,
                                                   Ordering ordering = Ordering::kBest);

}  // namespace holba
