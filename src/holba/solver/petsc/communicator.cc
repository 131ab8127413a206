// SPDX-License-Identifier: BSD-3-Clause
#include "holba/solver/petsc/communicator.h"

#include <algorithm>
#include <cstring>
#include <string>

#include "holba/base/check.h"

namespace holba::distributed {
namespace {

// One message holds at most so many doubles (MPI counts with an int), longer ranges several.
constexpr size_t kMaxMessage = size_t{1} << 27;
constexpr int kTag = 7;

}  // namespace

void CheckMpi(int code, const char* call) {
  HOLBA_CHECK_MSG(code == MPI_SUCCESS, std::string(call) + " failed");
}

Communicator::Communicator(MPI_Comm comm) : comm_(comm) {
  CheckMpi(MPI_Comm_rank(comm, &rank_), "MPI_Comm_rank");
  CheckMpi(MPI_Comm_size(comm, &size_), "MPI_Comm_size");
}

std::vector<double> Communicator::GatherFromAll(std::span<const double> mine) {
  std::vector<double> all(mine.size() * static_cast<size_t>(size_));
  const int n = static_cast<int>(mine.size());
  CheckMpi(MPI_Allgather(mine.data(), n, MPI_DOUBLE, all.data(), n, MPI_DOUBLE, comm_),
           "MPI_Allgather");
  ++traffic_.reductions;
  return all;
}

void Communicator::Sum(std::span<double> values) {
  const std::vector<double> all = GatherFromAll(values);
  std::fill(values.begin(), values.end(), 0.0);
  for (size_t r = 0; r < static_cast<size_t>(size_); ++r) {
    for (size_t i = 0; i < values.size(); ++i) values[i] += all[r * values.size() + i];
  }
}

bool Communicator::Agree(bool mine) {
  int value = mine ? 1 : 0;
  CheckMpi(MPI_Bcast(&value, 1, MPI_INT, 0, comm_), "MPI_Bcast");
  return value != 0;
}

double Communicator::FromFirst(double mine) {
  CheckMpi(MPI_Bcast(&mine, 1, MPI_DOUBLE, 0, comm_), "MPI_Bcast");
  return mine;
}

Exchange::Exchange(Communicator* communicator, std::vector<size_t> send_begin)
    : communicator_(communicator), send_begin_(std::move(send_begin)) {
  const size_t n = static_cast<size_t>(communicator->size());
  std::vector<uint64_t> send(n), receive(n);
  for (size_t r = 0; r < n; ++r) send[r] = send_begin_[r + 1] - send_begin_[r];
  CheckMpi(MPI_Alltoall(send.data(), 1, MPI_UINT64_T, receive.data(), 1, MPI_UINT64_T,
                        communicator->comm()),
           "MPI_Alltoall");
  receive_begin_.assign(1, 0);
  for (uint64_t count : receive) receive_begin_.push_back(receive_begin_.back() + count);
}

void Exchange::Forward(const double* send, double* receive) const {
  Run(send_begin_, send, receive_begin_, receive);
}
void Exchange::Backward(const double* received, double* sent) const {
  Run(receive_begin_, received, send_begin_, sent);
}

void Exchange::Run(const std::vector<size_t>& send_begin, const double* send,
                   const std::vector<size_t>& receive_begin, double* receive) const {
  const int me = communicator_->rank();
  std::vector<MPI_Request> requests;
  const auto for_each_message = [&](const std::vector<size_t>& begin, const auto& visit) {
    for (int r = 0; r < communicator_->size(); ++r) {
      if (r == me) continue;
      for (size_t at = begin[r]; at < begin[r + 1]; at += kMaxMessage)
        visit(r, at, static_cast<int>(std::min(kMaxMessage, begin[r + 1] - at)));
    }
  };
  for_each_message(receive_begin, [&](int r, size_t at, int count) {
    CheckMpi(MPI_Irecv(receive + at, count, MPI_DOUBLE, r, kTag, communicator_->comm(),
                       &requests.emplace_back()),
             "MPI_Irecv");
  });
  for_each_message(send_begin, [&](int r, size_t at, int count) {
    CheckMpi(MPI_Isend(send + at, count, MPI_DOUBLE, r, kTag, communicator_->comm(),
                       &requests.emplace_back()),
             "MPI_Isend");
    ++communicator_->traffic().messages;
    communicator_->traffic().bytes += static_cast<uint64_t>(count) * sizeof(double);
  });
  std::copy(send + send_begin[me], send + send_begin[me + 1], receive + receive_begin[me]);
  CheckMpi(MPI_Waitall(static_cast<int>(requests.size()), requests.data(), MPI_STATUSES_IGNORE),
           "MPI_Waitall");
}

}  // namespace holba::distributed
