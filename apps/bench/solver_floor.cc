// SPDX-License-Identifier: BSD-3-Clause
#include "apps/bench/solver_floor.h"

#include <Eigen/OrderingMethods>
#include <Eigen/SparseCore>
#include <algorithm>
#include <atomic>
#include <cstdint>
#include <thread>
#include <vector>

#if defined(__x86_64__)
#include <immintrin.h>
#endif

#include "holba/base/timer.h"

namespace holba {
namespace {

constexpr uint32_t kNone = ~uint32_t{0};
constexpr double kFlopsOfReprojection = 150.0;

// Kept blocks with free unknowns as nodes; which of them the elimination couples.
class NodeGraph {
 public:
  explicit NodeGraph(const Problem& problem) : index_(problem.num_blocks(), kNone) {
    for (BlockId id = 0; id < problem.num_blocks(); ++id) {
      const ParameterBlock& block = problem.block(id);
      if (!IsKept(block.role) || !block.IsVariable()) continue;
      index_[id] = static_cast<uint32_t>(widths_.size());
      widths_.push_back(block.FreeTangent());
    }
    words_ = (widths_.size() + 63) / 64;
    bits_.assign(widths_.size() * words_, 0);
  }

  uint32_t NodeOf(BlockId id) const { return index_[id]; }
  int width(uint32_t node) const { return widths_[node]; }
  size_t size() const { return widths_.size(); }

  void Couple(const std::vector<uint32_t>& nodes) {
    for (const uint32_t a : nodes) {
      for (const uint32_t b : nodes) bits_[a * words_ + b / 64] |= uint64_t{1} << (b % 64);
    }
  }

  // Of a supernodal Cholesky factor, nodes in the order of approximate minimum degree.
  double SparseFactorFlops() const {
    const auto n = static_cast<int>(widths_.size());
    if (n == 0) return 0.0;
    std::vector<Eigen::Triplet<double>> entries;
    for (int a = 0; a < n; ++a) {
      for (int b = 0; b < n; ++b) {
        if (a == b || At(a, b)) entries.emplace_back(a, b, 1.0);
      }
    }
    Eigen::SparseMatrix<double> matrix(n, n);
    matrix.setFromTriplets(entries.begin(), entries.end());
    Eigen::PermutationMatrix<Eigen::Dynamic, Eigen::Dynamic, int> order;
    Eigen::AMDOrdering<int>()(matrix, order);
    // AMDOrdering gives the node at each position, or its inverse as Eigen's own solvers use it;
    // both are permutations, and this is the one that Eigen::SimplicialLLT factorises with.
    const Eigen::PermutationMatrix<Eigen::Dynamic, Eigen::Dynamic, int> position = order.inverse();
    return FlopsInOrder(matrix, position.indices());
  }

 private:
  bool At(size_t a, size_t b) const { return bits_[a * words_ + b / 64] >> (b % 64) & 1; }

  double FlopsInOrder(const Eigen::SparseMatrix<double>& matrix,
                      const Eigen::VectorXi& position) const {
    const int n = static_cast<int>(matrix.cols());
    std::vector<int> node_at(n);
    for (int a = 0; a < n; ++a) node_at[position[a]] = a;
    // Rows below the diagonal of each column: those of the matrix and of its children in the
    // elimination tree.
    std::vector<std::vector<int>> below(n), children(n);
    std::vector<int> mark(n, -1);
    double flops = 0.0;
    for (int k = 0; k < n; ++k) {
      std::vector<int>& rows = below[k];
      mark[k] = k;
      const auto add = [&](int row) {
        if (row <= k || mark[row] == k) return;
        mark[row] = k;
        rows.push_back(row);
      };
      for (Eigen::SparseMatrix<double>::InnerIterator it(matrix, node_at[k]); it; ++it) {
        add(position[it.row()]);
      }
      for (const int child : children[k]) {
        for (const int row : below[child]) add(row);
        std::vector<int>().swap(below[child]);
      }
      const double w = widths_[node_at[k]];
      double m = 0.0;
      int parent = n;
      for (const int row : rows) {
        m += widths_[node_at[row]];
        parent = std::min(parent, row);
      }
      if (parent < n) children[parent].push_back(k);
      flops += w * w * w / 3.0 + w * w * m + w * m * (m + 1.0);
    }
    return flops;
  }

  std::vector<uint32_t> index_;
  std::vector<int> widths_;
  size_t words_ = 0;
  std::vector<uint64_t> bits_;
};

#if defined(__x86_64__)
// Multiply-adds of `rounds` rounds in registers; the result depends on all of them.
__attribute__((target("avx512f"))) double MultiplyAdd512(int64_t rounds) {
  __m512d sums[16];
  for (int i = 0; i < 16; ++i) sums[i] = _mm512_set1_pd(i);
  const __m512d a = _mm512_set1_pd(0.999999), b = _mm512_set1_pd(1e-9);
  for (int64_t r = 0; r < rounds; ++r) {
#pragma GCC unroll 16
    for (int i = 0; i < 16; ++i) sums[i] = _mm512_fmadd_pd(sums[i], a, b);
  }
  for (int i = 1; i < 16; ++i) sums[0] = _mm512_add_pd(sums[0], sums[i]);
  return sums[0][0];
}
__attribute__((target("avx2,fma"))) double MultiplyAdd256(int64_t rounds) {
  __m256d sums[12];
  for (int i = 0; i < 12; ++i) sums[i] = _mm256_set1_pd(i);
  const __m256d a = _mm256_set1_pd(0.999999), b = _mm256_set1_pd(1e-9);
  for (int64_t r = 0; r < rounds; ++r) {
#pragma GCC unroll 12
    for (int i = 0; i < 12; ++i) sums[i] = _mm256_fmadd_pd(sums[i], a, b);
  }
  for (int i = 1; i < 12; ++i) sums[0] = _mm256_add_pd(sums[0], sums[i]);
  return sums[0][0];
}
#endif

double MultiplyAddBaseline(int64_t rounds) {
  using Pair = double __attribute__((vector_size(16)));
  Pair sums[12];
  for (int i = 0; i < 12; ++i) sums[i] = Pair{} + static_cast<double>(i);
  const Pair a = Pair{} + 0.999999, b = Pair{} + 1e-9;
  for (int64_t r = 0; r < rounds; ++r) {
#pragma GCC unroll 12
    for (int i = 0; i < 12; ++i) sums[i] = sums[i] * a + b;
  }
  for (int i = 1; i < 12; ++i) sums[0] += sums[i];
  return sums[0][0];
}

struct Loop {
  double (*run)(int64_t rounds);
  double flops_per_round;
};
Loop WidestLoop() {
#if defined(__x86_64__)
  if (__builtin_cpu_supports("avx512f")) return {&MultiplyAdd512, 16 * 8 * 2};
  if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")) {
    return {&MultiplyAdd256, 12 * 4 * 2};
  }
#endif
  return {&MultiplyAddBaseline, 12 * 2 * 2};
}

}  // namespace

double IterationFlops::Factor() const { return std::min(dense_factor, sparse_factor); }

IterationFlops CountIterationFlops(const Problem& problem) {
  IterationFlops flops;
  NodeGraph graph(problem);
  // Different kept nodes of every feature.
  std::vector<std::vector<uint32_t>> nodes_of(problem.num_blocks());
  std::vector<uint32_t> nodes;
  for (const auto& batch : problem.batches()) {
    const double d = batch->dim();
    for (size_t i = 0; i < batch->size(); ++i) {
      double f = 0.0, w = 0.0;
      BlockId feature = 0;
      nodes.clear();
      for (int s = 0; s < batch->num_slots(); ++s) {
        const BlockId id = batch->block(i, s);
        const ParameterBlock& block = problem.block(id);
        const int free = block.FreeTangent();
        if (free == 0) continue;
        if (!IsKept(block.role)) {
          f = free;
          feature = id;
        } else {
          w += free;
          nodes.push_back(graph.NodeOf(id));
        }
      }
      if (f == 0.0 && w == 0.0) continue;
      flops.linearise += kFlopsOfReprojection * d / 2.0;
      flops.eliminate += d * f * (f + 1) + 2 * d * f + 2 * d * w + d * w * (w + 1);
      if (f == 0.0) {
        graph.Couple(nodes);
        continue;
      }
      flops.eliminate += d * f * f + 2 * d * f * w + 2 * f * w;
      flops.back_substitute += 2 * f * w + f * f;
      nodes_of[feature].insert(nodes_of[feature].end(), nodes.begin(), nodes.end());
    }
  }
  for (BlockId id = 0; id < problem.num_blocks(); ++id) {
    std::vector<uint32_t>& of_feature = nodes_of[id];
    if (of_feature.empty()) continue;
    std::sort(of_feature.begin(), of_feature.end());
    of_feature.erase(std::unique(of_feature.begin(), of_feature.end()), of_feature.end());
    double W = 0.0;
    for (const uint32_t node : of_feature) W += graph.width(node);
    flops.eliminate += problem.block(id).FreeTangent() * W * (W + 1);
    graph.Couple(of_feature);
  }
  double n = 0.0;
  for (uint32_t node = 0; node < graph.size(); ++node) n += graph.width(node);
  flops.dense_factor = n * n * n / 3.0;
  flops.sparse_factor = graph.SparseFactorFlops();
  return flops;
}

double MeasurePeakGflops(int num_threads) {
  const Loop loop = WidestLoop();
  constexpr int64_t kRounds = 2'000'000;
  constexpr int kRuns = 7;
  double best = 0.0;
  for (int run = 0; run < kRuns; ++run) {
    std::atomic<int> ready = 0;
    std::vector<double> seconds(num_threads), results(num_threads);
    const auto work = [&](int t) {
      results[t] = loop.run(kRounds / 20);  // the wide units wake up
      ++ready;
      while (ready < num_threads) {
      }
      const Timer timer;
      results[t] += loop.run(kRounds);
      seconds[t] = timer.Seconds();
    };
    std::vector<std::thread> threads;
    for (int t = 1; t < num_threads; ++t) threads.emplace_back(work, t);
    work(0);
    for (std::thread& thread : threads) thread.join();
    const double slowest = *std::max_element(seconds.begin(), seconds.end());
    volatile double keep = results[0];
    static_cast<void>(keep);
    best = std::max(best, 1e-9 * loop.flops_per_round * kRounds * num_threads / slowest);
  }
  return best;
}

}  // namespace holba
