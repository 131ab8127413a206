// SPDX-License-Identifier: BSD-3-Clause
// What an adjustment on several ranks would send, compute and hold, counted from the structure of
// the problem in one process: no values, no communication. Checked against what ranks really send.
#pragma once

#include <cstddef>
#include <vector>

#include "holba/problem/problem.h"

namespace holba::distributed {

struct RankCounts {
  size_t features = 0, residuals = 0;
  size_t poses = 0, shared_poses = 0;  // with features here; of these, owned by other ranks
  size_t own_unknowns = 0, shared_unknowns = 0;
  // Ranks that it sends to or gets from, besides those of sums over all.
  size_t neighbours = 0;
  // Sent in an iteration whose step is accepted: blocks and vectors of other ranks' rows to their
  // owners, and the entries of a step back. A product with the matrix, of which conjugate gradients
  // take one a step, sends one vector of the entries that `product_bytes` counts.
  size_t messages = 0, bytes = 0, product_bytes = 0;
  double flops = 0.0;         // of the elimination: products of pairs of nodes
  double matrix_bytes = 0.0;  // own rows of the reduced system
  double part_bytes = 0.0;    // its own blocks before they are sent
};

// One entry for each of num_ranks ranks.
std::vector<RankCounts> CountRanks(const Problem& problem, int num_ranks);

}  // namespace holba::distributed
