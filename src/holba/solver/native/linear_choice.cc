// SPDX-License-Identifier: BSD-3-Clause
#include "holba/solver/native/linear_choice.h"

#include <algorithm>

#include "holba/linear/reduced_solver.h"

namespace holba::native {
namespace {

// Speeds measured on one core of a 2023 server with AVX-512; only their ratios matter.
constexpr double kDenseFlopsPerSecond = 1e11, kSparseFlopsPerSecond = 4e10;
constexpr double kPairsPerSecond = 1e8;  // blocks of 6 x 6 that elimination adds to S
// Of T, in products with S, from memory and where it fits into the caches.
constexpr double kStoredBytesPerSecond = 1e10, kCachedBytesPerSecond = 2e10, kCacheBytes = 4e6;
// Products that conjugate gradients are taken to need for one step (eta 0.1), by the share of the
// pairs of nodes that are coupled: errors travel in few products where all images share points, in
// many along a street. Fitted: with these the choice was the faster one, or as fast, on ring,
// random, near, collection and sequence scenes of 100 to 500 images.
constexpr double kProductsTimesDensity = 6.0, kMaxProducts = 100.0;
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
  const double n = static_cast<double>(pattern.num_nodes());
  const double density = static_cast<double>(pattern.num_blocks()) / (0.5 * n * (n + 1.0));
  const double products = std::min(kProductsTimesDensity / density, kMaxProducts);
  const double iterative_seconds =
      products * 2.0 * stored_bytes /
      (stored_bytes < kCacheBytes ? kCachedBytesPerSecond : kStoredBytesPerSecond);
  // The fill-in need not be known where elimination and a dense bound already decide.
  if (pattern.num_unknowns <= kMinSparseUnknowns) return direct;
  const double direct_seconds =
      structure.num_pairs / kPairsPerSecond +
      (direct == LinearSolver::kSparse ? SparseSeconds(pattern) : DenseSeconds(pattern));
  return kInexactPenalty * iterative_seconds < direct_seconds ? LinearSolver::kIterative : direct;
}

}  // namespace holba::native
