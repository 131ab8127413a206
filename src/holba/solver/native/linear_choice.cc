// SPDX-License-Identifier: BSD-3-Clause
#include "holba/solver/native/linear_choice.h"

#include <algorithm>

#include "holba/linear/reduced_solver.h"

namespace holba::native {
namespace {

// Speeds of one core of a 2023 server with AVX-512. Only their ratios matter.
constexpr double kDenseFlopsPerSecond = 1e11, kSparseFlopsPerSecond = 4e10;
constexpr double kPairsPerSecond = 1e8;  // blocks of 6 x 6 that elimination adds to S
// Reading T in products with S, from memory and from the caches where it fits into them.
constexpr double kStoredBytesPerSecond = 1e10, kCachedBytesPerSecond = 2e10, kCacheBytes = 4e6;
// Predicted number of products of one step by conjugate gradients (eta 0.1), from the share of the
// pairs of nodes that are coupled: errors spread in few products where all images share points, and
// in many along a street. The numbers are fitted: on ring, random, near, collection and sequence
// scenes of 100 to 500 images no other choice was faster.
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
  if (pattern.num_unknowns <= kMinSparseUnknowns) return direct;
  const double direct_seconds =
      structure.num_pairs / kPairsPerSecond +
      (direct == LinearSolver::kSparse ? SparseSeconds(pattern) : DenseSeconds(pattern));
  return kInexactPenalty * iterative_seconds < direct_seconds ? LinearSolver::kIterative : direct;
}

}  // namespace holba::native
