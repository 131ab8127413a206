// SPDX-License-Identifier: BSD-3-Clause
#include "holba/solver/native/linear_choice.h"

#include "holba/linear/reduced_solver.h"

namespace holba::native {
namespace {

// Speeds measured on one core of a 2023 server with AVX-512; only their ratios matter.
constexpr double kDenseFlopsPerSecond = 1e11, kSparseFlopsPerSecond = 4e10;
constexpr double kPairsPerSecond = 1e8;        // blocks of 6 x 6 that elimination adds to S
constexpr double kStoredBytesPerSecond = 5e9;  // of T, in products with S
constexpr double kExpectedProducts = 30.0;     // of conjugate gradients for one step
// An exact step is worth this many inexact ones.
constexpr double kInexactPenalty = 2.0;
// Below this many unknowns the dense factor is the fastest, whatever the pattern.
constexpr size_t kMinSparseUnknowns = 200;

double SparseSeconds(const BlockPattern& pattern) {
  return PredictSparseFlops(pattern) / kSparseFlopsPerSecond;
}
double DenseSeconds(const BlockPattern& pattern) {
  return PredictDenseFlops(pattern) / kDenseFlopsPerSecond;
}

}  // namespace

bool IsSparseFaster(const BlockPattern& pattern) {
  return pattern.num_unknowns > kMinSparseUnknowns && !pattern.full &&
         SparseSeconds(pattern) < DenseSeconds(pattern);
}

LinearSolver ChooseLinearSolver(const Structure& structure, const BlockPattern& pattern) {
  const LinearSolver direct =
      IsSparseFaster(pattern) ? LinearSolver::kSparse : LinearSolver::kDense;
  double stored_bytes = 0.0;
  for (const Chunk& chunk : structure.chunks) stored_bytes += 4.0 * chunk.w_size;
  const double iterative_seconds = kExpectedProducts * 2.0 * stored_bytes / kStoredBytesPerSecond;
  // The fill-in need not be known where elimination and a dense bound already decide.
  if (pattern.num_unknowns <= kMinSparseUnknowns) return direct;
  const double direct_seconds =
      structure.num_pairs / kPairsPerSecond +
      (direct == LinearSolver::kSparse ? SparseSeconds(pattern) : DenseSeconds(pattern));
  return kInexactPenalty * iterative_seconds < direct_seconds ? LinearSolver::kIterative : direct;
}

}  // namespace holba::native
