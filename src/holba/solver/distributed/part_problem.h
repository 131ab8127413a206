// SPDX-License-Identifier: BSD-3-Clause
// One part of a partitioned problem, as a problem of its own.
#pragma once

#include <vector>

#include "holba/problem/problem.h"
#include "holba/solver/distributed/partition.h"

namespace holba::distributed {

// Has the residuals of one part and the blocks that these hold, with the roles, constness and held
// coordinates of the whole; of its batches those that have residuals in the part, in their order.
class PartProblem {
 public:
  // `whole` must outlive the part or be replaced by Renew.
  PartProblem(const Problem& whole, const Partition& partition, int part);
  PartProblem(const PartProblem&) = delete;
  PartProblem& operator=(const PartProblem&) = delete;

  Problem& problem() { return problem_; }
  const Problem& problem() const { return problem_; }
  // The block of the whole that each block of the part is.
  const std::vector<BlockId>& block_of_whole() const { return block_of_whole_; }
  // The batch of the whole that each batch of the part belongs to.
  const std::vector<size_t>& batch_of_whole() const { return batch_of_whole_; }
  // The residuals of that batch of the whole that the part has, ascending.
  const std::vector<uint32_t>& residuals(size_t whole_batch) const {
    return residuals_[whole_batch];
  }

  // Takes values, measurements, losses and weights of a problem with the structure of the whole.
  void Renew(const Problem& whole);
  // Puts the part's values of these blocks of the part into the state of the whole.
  void WriteBack(const std::vector<BlockId>& blocks, Problem* whole) const;

 private:
  class PartBatch;

  Problem problem_;
  std::vector<BlockId> block_of_whole_;
  std::vector<std::vector<uint32_t>> residuals_;
  std::vector<size_t> batch_of_whole_;
  std::vector<PartBatch*> batches_;      // owned by problem_
  std::vector<size_t> offset_of_whole_;  // by block of the whole: where its values are in the part
};

}  // namespace holba::distributed
