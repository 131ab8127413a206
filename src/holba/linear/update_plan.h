// SPDX-License-Identifier: BSD-3-Clause
// Memory for the updates that the fronts of a sparse factor pass to their parents.
#pragma once

#include <cstddef>
#include <vector>

#include "holba/linear/elimination.h"

namespace holba {

struct UpdatePlan {
  std::vector<size_t> offset;  // of each supernode's update
  size_t size = 0;             // of the memory for all
};

// sizes: of the update of each supernode, which is needed from the elimination of its front to the
// assembly of its parent's front. subtrees: roots of subtrees, each of which one thread works on
// while others work on other subtrees; every other front comes after its children. Memory is used
// again by a writer that certainly comes after the reader: one in the same subtree or above the
// reader.
UpdatePlan PlanUpdateMemory(const Elimination& plan, const std::vector<int>& subtrees,
                            const std::vector<size_t>& sizes);

}  // namespace holba
