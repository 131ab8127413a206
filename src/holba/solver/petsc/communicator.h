// SPDX-License-Identifier: BSD-3-Clause
// The processes ("ranks") that solve a problem together. Every function is called by all of them.
// Sums are taken in the order of the ranks, so that they repeat for a given number of ranks.
#pragma once

#include <mpi.h>

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace holba::distributed {

// What this rank has sent.
struct Traffic {
  uint64_t messages = 0, bytes = 0;  // from rank to rank
  uint64_t reductions = 0;           // sums over all ranks
};

class Communicator {
 public:
  explicit Communicator(MPI_Comm comm);

  MPI_Comm comm() const { return comm_; }
  int rank() const { return rank_; }
  int size() const { return size_; }

  // What every rank has, one after another.
  std::vector<double> GatherFromAll(std::span<const double> mine);
  // By entry, in the order of the ranks.
  void Sum(std::span<double> values);
  // What rank 0 says.
  bool Agree(bool mine);
  double FromFirst(double mine);
  // Lists of different lengths, one after another; begin: one entry more than ranks.
  template <typename T>
  std::vector<T> GatherLists(std::span<const T> mine, std::vector<size_t>* begin);

  Traffic& traffic() { return traffic_; }

 private:
  MPI_Comm comm_;
  int rank_ = 0, size_ = 1;
  Traffic traffic_;
};

// A fixed exchange of doubles: from each rank a range to each other, in both directions.
class Exchange {
 public:
  Exchange() = default;
  // `send_begin`: where what goes to each rank begins among the doubles that this rank sends; one
  // entry more than there are ranks. What a rank sends to itself takes part without a message.
  Exchange(Communicator* communicator, std::vector<size_t> send_begin);

  const std::vector<size_t>& receive_begin() const { return receive_begin_; }
  size_t send_size() const { return send_begin_.back(); }
  size_t receive_size() const { return receive_begin_.back(); }

  void Forward(const double* send, double* receive) const;
  // From the receivers of Forward to its senders.
  void Backward(const double* received, double* sent) const;

 private:
  void Run(const std::vector<size_t>& send_begin, const double* send,
           const std::vector<size_t>& receive_begin, double* receive) const;

  Communicator* communicator_ = nullptr;
  std::vector<size_t> send_begin_, receive_begin_;
};

// Throws what MPI says about a failed call.
void CheckMpi(int code, const char* call);

template <typename T>
std::vector<T> Communicator::GatherLists(std::span<const T> mine, std::vector<size_t>* begin) {
  const int count = static_cast<int>(mine.size_bytes());
  std::vector<int> counts(size_), offsets(size_);
  CheckMpi(MPI_Allgather(&count, 1, MPI_INT, counts.data(), 1, MPI_INT, comm_), "MPI_Allgather");
  begin->assign(1, 0);
  int total = 0;
  for (int r = 0; r < size_; ++r) {
    offsets[r] = total;
    total += counts[r];
    begin->push_back(static_cast<size_t>(total) / sizeof(T));
  }
  std::vector<T> all(begin->back());
  CheckMpi(MPI_Allgatherv(mine.data(), count, MPI_BYTE, all.data(), counts.data(), offsets.data(),
                          MPI_BYTE, comm_),
           "MPI_Allgatherv");
  return all;
}

}  // namespace holba::distributed
