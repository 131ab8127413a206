// SPDX-License-Identifier: BSD-3-Clause
// The reduced system spread over ranks: each owns the rows of its cells (distributed/cells.h), and
// adds up there what all of them contribute.
#pragma once

#include <vector>

#include "holba/solver/distributed/cells.h"
#include "holba/solver/petsc/communicator.h"

namespace holba::distributed {

class DistributedSystem {
 public:
  DistributedSystem(const Problem& whole, const Partition& partition,
                    const std::vector<BlockId>& block_of_whole,
                    const native::NormalEquations& equations, Communicator* communicator);

  const CellLayout& layout() const { return layout_; }
  Communicator& communicator() const { return *communicator_; }

  // The rows that this rank owns: pairs of cells in the upper triangle, sorted, and the place of
  // each in values(), row by row. Each row begins with its diagonal.
  const std::vector<CellPair>& pairs() const { return pairs_; }
  const std::vector<size_t>& pair_offset() const { return pair_offset_; }
  const std::vector<double>& values() const { return values_; }
  uint32_t first_cell() const { return layout_.first_of_part[communicator_->rank()]; }
  uint32_t end_cell() const { return layout_.first_of_part[communicator_->rank() + 1]; }
  size_t num_own_unknowns() const {
    return layout_.begin[end_cell()] - layout_.begin[first_cell()];
  }
  // Unknowns of other ranks' rows that this rank contributes to.
  size_t num_shared_unknowns() const;
  // The right hand side of the own rows.
  const std::vector<double>& rhs() const { return rhs_; }

  // Adds up what NormalEquations::LinearisePart of all ranks has left, and damps it. The largest
  // entry of the gradient of the own cells.
  double Assemble(const native::NormalEquations& equations, double radius);

  // From the own cells' entries of the solution to the step of the part's kept unknowns.
  void Distribute(const std::vector<double>& solution, std::span<double> step);

 private:
  void FindOwnPairs();

  CellLayout layout_;
  Communicator* communicator_;
  Contribution contribution_;
  Exchange blocks_, vectors_, steps_;

  std::vector<CellPair> pairs_;
  std::vector<size_t> pair_offset_;
  std::vector<double> values_, rhs_;
  // For each pair and each cell that is received: its index in pairs_, and its own first unknown.
  std::vector<uint32_t> received_pair_;
  std::vector<size_t> received_at_, received_cell_at_;
  std::vector<int> received_width_;
  std::vector<double> send_, receive_, sums_;
};

}  // namespace holba::distributed
