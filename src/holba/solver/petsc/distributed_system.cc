// SPDX-License-Identifier: BSD-3-Clause
#include "holba/solver/petsc/distributed_system.h"

#include <algorithm>
#include <cmath>

namespace holba::distributed {
namespace {

// Gradient, diagonal and reduction travel together.
constexpr size_t kVectors = 3;

// Lists of cells or of pairs that go to each rank, sent there: what this rank gets, rank by rank.
template <typename T>
std::vector<T> SendLists(const std::vector<T>& list, const std::vector<size_t>& begin,
                         const Communicator& communicator) {
  const int n = communicator.size();
  std::vector<int> send_counts(n), send_at(n), counts(n), at(n);
  for (int r = 0; r < n; ++r) {
    send_counts[r] = static_cast<int>((begin[r + 1] - begin[r]) * sizeof(T));
    send_at[r] = static_cast<int>(begin[r] * sizeof(T));
  }
  CheckMpi(
      MPI_Alltoall(send_counts.data(), 1, MPI_INT, counts.data(), 1, MPI_INT, communicator.comm()),
      "MPI_Alltoall");
  int total = 0;
  for (int r = 0; r < n; ++r) {
    at[r] = total;
    total += counts[r];
  }
  std::vector<T> received(static_cast<size_t>(total) / sizeof(T));
  CheckMpi(MPI_Alltoallv(list.data(), send_counts.data(), send_at.data(), MPI_BYTE, received.data(),
                         counts.data(), at.data(), MPI_BYTE, communicator.comm()),
           "MPI_Alltoallv");
  return received;
}

// Where the doubles of each rank begin, from where its entries do.
std::vector<size_t> Scaled(const std::vector<size_t>& begin, const std::vector<size_t>& offset,
                           size_t factor) {
  std::vector<size_t> scaled;
  for (size_t b : begin) scaled.push_back(offset[b] * factor);
  return scaled;
}

}  // namespace

DistributedSystem::DistributedSystem(const Problem& whole, const Partition& partition,
                                     const std::vector<BlockId>& block_of_whole,
                                     const native::NormalEquations& equations,
                                     Communicator* communicator)
    : layout_(MakeCellLayout(whole, partition)),
      communicator_(communicator),
      contribution_(equations.structure(), equations.pattern(), block_of_whole, layout_) {
  const Contribution& c = contribution_;
  blocks_ = Exchange(communicator, Scaled(c.pairs_of_part, c.pair_offset(), 1));
  vectors_ = Exchange(communicator, Scaled(c.cells_of_part, c.cell_offset(), kVectors));
  steps_ = Exchange(communicator, Scaled(c.cells_of_part, c.cell_offset(), 1));
  FindOwnPairs();
  rhs_.resize(num_own_unknowns());
}

void DistributedSystem::FindOwnPairs() {
  const std::vector<CellPair> received =
      SendLists(contribution_.pairs(), contribution_.pairs_of_part, *communicator_);
  pairs_ = received;
  for (uint32_t c = first_cell(); c < end_cell(); ++c) pairs_.push_back({c, c});
  std::sort(pairs_.begin(), pairs_.end());
  pairs_.erase(std::unique(pairs_.begin(), pairs_.end()), pairs_.end());
  pair_offset_.assign(1, 0);
  const auto size_of = [&](const CellPair& pair) {
    return static_cast<size_t>(layout_.padded[pair.row]) * layout_.padded[pair.column];
  };
  for (const CellPair& pair : pairs_) pair_offset_.push_back(pair_offset_.back() + size_of(pair));
  values_.assign(pair_offset_.back(), 0.0);
  size_t at = 0;
  for (const CellPair& pair : received) {
    received_pair_.push_back(static_cast<uint32_t>(
        std::lower_bound(pairs_.begin(), pairs_.end(), pair) - pairs_.begin()));
    received_at_.push_back(at);
    at += size_of(pair);
  }
  for (uint32_t cell :
       SendLists(contribution_.cells(), contribution_.cells_of_part, *communicator_)) {
    received_cell_at_.push_back(layout_.begin[cell] - layout_.begin[first_cell()]);
    received_width_.push_back(layout_.padded[cell]);
  }
}

size_t DistributedSystem::num_shared_unknowns() const {
  const std::vector<size_t>& offset = contribution_.cell_offset();
  const int me = communicator_->rank();
  const size_t own =
      offset[contribution_.cells_of_part[me + 1]] - offset[contribution_.cells_of_part[me]];
  return offset.back() - own;
}

double DistributedSystem::Assemble(const native::NormalEquations& equations, double radius) {
  contribution_.PackBlocks(equations.matrix(), &send_);
  receive_.resize(blocks_.receive_size());
  blocks_.Forward(send_.data(), receive_.data());
  std::fill(values_.begin(), values_.end(), 0.0);
  for (size_t i = 0; i < received_pair_.size(); ++i) {
    const size_t to = pair_offset_[received_pair_[i]];
    const size_t size = pair_offset_[received_pair_[i] + 1] - to;
    const double* from = receive_.data() + received_at_[i];
    for (size_t k = 0; k < size; ++k) values_[to + k] += from[k];
  }

  // The three vectors of one rank stand in one message, vector by vector.
  const std::vector<size_t>& offset = contribution_.cell_offset();
  std::vector<double> packed[kVectors];
  const double* const vectors[kVectors] = {equations.gradient().data(), equations.diagonal().data(),
                                           equations.reduction().data()};
  send_.resize(vectors_.send_size());
  for (size_t v = 0; v < kVectors; ++v) {
    packed[v].resize(offset.back());
    contribution_.PackVector(vectors[v], packed[v].data());
  }
  double* out = send_.data();
  for (int r = 0; r < communicator_->size(); ++r) {
    const size_t begin = offset[contribution_.cells_of_part[r]];
    const size_t end = offset[contribution_.cells_of_part[r + 1]];
    for (size_t v = 0; v < kVectors; ++v)
      out = std::copy(packed[v].begin() + begin, packed[v].begin() + end, out);
  }
  receive_.resize(vectors_.receive_size());
  vectors_.Forward(send_.data(), receive_.data());
  const size_t n = num_own_unknowns();
  sums_.assign(kVectors * n, 0.0);
  size_t cell = 0;
  for (int r = 0; r < communicator_->size(); ++r) {
    const size_t begin = vectors_.receive_begin()[r];
    const size_t length = (vectors_.receive_begin()[r + 1] - begin) / kVectors;
    for (size_t done = 0; done < length; ++cell) {
      for (size_t v = 0; v < kVectors; ++v) {
        for (int i = 0; i < received_width_[cell]; ++i)
          sums_[v * n + received_cell_at_[cell] + i] += receive_[begin + v * length + done + i];
      }
      done += static_cast<size_t>(received_width_[cell]);
    }
  }

  const double *gradient = sums_.data(), *diagonal = gradient + n, *reduction = diagonal + n;
  double max_gradient = 0.0;
  for (size_t p = 0; p < pairs_.size(); ++p) {
    if (pairs_[p].row != pairs_[p].column) continue;
    const uint32_t own_cell = pairs_[p].row;
    const size_t at = layout_.begin[own_cell] - layout_.begin[first_cell()];
    const int width = layout_.padded[own_cell];
    for (int i = 0; i < width; ++i) {
      // Any pivot gives a coordinate that is held, whose row and column are zero, a zero step.
      const bool is_free = layout_.free[layout_.begin[own_cell] + i] != 0;
      values_[pair_offset_[p] + static_cast<size_t>(i) * (width + 1)] +=
          is_free ? native::KeptDamping(diagonal[at + i], radius) : 1.0;
      rhs_[at + i] = reduction[at + i] - gradient[at + i];
      // The negation lets a NaN through.
      if (!(std::abs(gradient[at + i]) <= max_gradient)) max_gradient = std::abs(gradient[at + i]);
    }
  }
  return max_gradient;
}

void DistributedSystem::Distribute(const std::vector<double>& solution, std::span<double> step) {
  receive_.resize(steps_.receive_size());
  double* out = receive_.data();
  for (size_t i = 0; i < received_cell_at_.size(); ++i)
    out = std::copy_n(solution.data() + received_cell_at_[i], received_width_[i], out);
  send_.resize(steps_.send_size());
  steps_.Backward(receive_.data(), send_.data());
  std::fill(step.begin(), step.end(), 0.0);
  contribution_.UnpackVector(send_.data(), step.data());
}

}  // namespace holba::distributed
