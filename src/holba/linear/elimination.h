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
  std::vector<int> node_at;   // node at each position of the elimination order
  std::vector<int> position;  // position of each node
  std::vector<int> begin;     // supernode s has the positions begin[s] .. begin[s + 1] - 1
  std::vector<int> parent;    // of supernode s: a supernode after s; -1: s is a root
  std::vector<int> first_descendant;  // the subtree of s is first_descendant[s] .. s
  // The rows of supernode s below its own positions, row[row_begin[s]] .. row[row_begin[s + 1] -
  // 1], as ascending positions.
  std::vector<size_t> row_begin;
  std::vector<int> row;
  double flops = 0.0;  // without the zeros that merged supernodes store

  int num_supernodes() const { return static_cast<int>(parent.size()); }
};

enum class Ordering { kBest, kMinimumDegree, kNestedDissection };

// kBest: approximate minimum degree, or nested dissection where it needs fewer operations and the
// difference repays the search for it.
std::shared_ptr<const Elimination> PlanElimination(const BlockPattern& pattern,
                                                   Ordering ordering = Ordering::kBest);

}  // namespace holba
