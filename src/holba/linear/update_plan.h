// SPDX-License-Identifier: BSD-3-Clause
// Memory for what the fronts of a sparse factor leave to their parents.
#pragma once

#include <cstddef>
#include <vector>

#include "holba/linear/elimination.h"

namespace holba {

struct UpdatePlan {
  std::vector<size_t> offset;  // of each supernode's update
  size_t size = 0;             // of the memory for all
};

// sizes: of each supernode's update, which lives from the work on its front to the assembly of its
// parent's. subtrees: roots of subtrees that are worked on by one thread each, at the same time as
// others; every other front comes after its children. Memory is used again once its reader is done
// and the next writer is sure to come after that: in the same subtree, or above the reader.
UpdatePlan PlanUpdateMemory(const Elimination& plan, const std::vector<int>& subtrees,
                            const std::vector<size_t>& sizes);

}  // namespace holba
