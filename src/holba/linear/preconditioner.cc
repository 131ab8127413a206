// SPDX-License-Identifier: BSD-3-Clause
#include "holba/linear/preconditioner.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>

#include "holba/base/check.h"
#include "holba/base/threads.h"
#include "holba/simd/targets.h"

namespace holba {

HOLBA_SIMD_DECLARE(void SubtractProduct(int padded_rows, int inner, int columns, const double* h,
                                        const double* b, size_t b_row_stride,
                                        size_t b_column_stride, double* c))

namespace {

constexpr int kMaxWidth = BlockPattern::kMaxWidth;
constexpr size_t kNoBlock = std::numeric_limits<size_t>::max();
constexpr size_t kNodesPerTask = 256;
constexpr size_t kArmsPerChunk = 256;
// Rows of the Schur complement that one task computes: with 2000 unknowns they fit into the second
// level of cache.
constexpr int kUnknownsPerTask = 32;
// The sparse factor of the Schur complement is used if its operations, which are slower, are fewer
// than this share of the dense ones.
constexpr double kSparseAdvantage = 0.3;

size_t NumTasks(size_t size, size_t per_task) { return (size + per_task - 1) / per_task; }

using SmallMatrix = std::array<double, kMaxWidth * kMaxWidth>;  // column by column, width rows

// L L^T = A + shift I in the lower triangle of L. False if a pivot is lost in rounding.
bool FactoriseSmall(const SmallMatrix& A, int width, double shift, SmallMatrix* L) {
  const double min_pivot = 8.0 * width * std::numeric_limits<double>::epsilon();
  for (int j = 0; j < width; ++j) {
    for (int i = j; i < width; ++i) {
      double sum = A[j * width + i] + (i == j ? shift : 0.0);
      for (int k = 0; k < j; ++k) sum -= (*L)[k * width + i] * (*L)[k * width + j];
      if (i == j) {
        if (!(sum > min_pivot)) return false;
        (*L)[j * width + j] = std::sqrt(sum);
      } else {
        (*L)[j * width + i] = sum / (*L)[j * width + j];
      }
    }
  }
  return true;
}

// inverse = scale (L L^T)^-1 scale, column by column.
void InvertFactorised(int width, const double* scale, SmallMatrix* L, double* inverse) {
  // L^-1 in place of L, column by column: column j of it needs only columns from j on.
  for (int j = 0; j < width; ++j) {
    double* column = L->data() + j * width;
    column[j] = 1.0 / column[j];
    for (int i = j + 1; i < width; ++i) {
      double sum = 0.0;
      for (int k = j; k < i; ++k) sum -= (*L)[k * width + i] * column[k];
      column[i] = sum / (*L)[i * width + i];
    }
  }
  for (int j = 0; j < width; ++j) {
    for (int i = j; i < width; ++i) {
      double sum = 0.0;
      for (int k = i; k < width; ++k) sum += (*L)[i * width + k] * (*L)[j * width + k];
      inverse[j * width + i] = inverse[i * width + j] = scale[i] * sum * scale[j];
    }
  }
}

// The inverse of a block of stride PaddedWidth(width). A block that is not positive definite is
// repaired as Set says; then false.
bool InvertBlock(const double* block, int width, double* inverse) {
  const int stride = PaddedWidth(width);
  std::array<double, kMaxWidth> scale;
  bool intact = true, finite = true;
  for (int i = 0; i < width; ++i) {
    double diagonal = block[i * stride + i];
    if (!(diagonal > 0.0) || !std::isfinite(diagonal)) {
      intact = false;
      diagonal = std::isfinite(diagonal) && diagonal != 0.0 ? -diagonal : 1.0;
      scale[i] = -1.0 / std::sqrt(diagonal);  // the sign marks the row, which is set to zero below
    } else {
      scale[i] = 1.0 / std::sqrt(diagonal);
    }
  }
  SmallMatrix scaled, factor;
  for (int j = 0; j < width; ++j) {
    scaled[j * width + j] = 1.0;
    for (int i = j + 1; i < width; ++i) {
      const bool cut = scale[i] < 0.0 || scale[j] < 0.0;
      const double entry = cut ? 0.0 : scale[i] * block[j * stride + i] * scale[j];
      scaled[j * width + i] = entry;
      finite = finite && std::isfinite(entry);
    }
  }
  for (int i = 0; i < width; ++i) scale[i] = std::abs(scale[i]);

  double shift = 0.0;
  if (finite) {
    while (!FactoriseSmall(scaled, width, shift, &factor)) {
      intact = false;
      // No matrix that was meant to be definite needs so large a shift: only its diagonal is used.
      shift = shift == 0.0 ? 1e-10 : 100.0 * shift;
      if (shift > 1e4) {
        finite = false;
        break;
      }
    }
  }
  if (!finite) {
    std::fill(inverse, inverse + width * width, 0.0);
    for (int i = 0; i < width; ++i) inverse[i * width + i] = scale[i] * scale[i];
    return false;
  }
  InvertFactorised(width, scale.data(), &factor, inverse);
  return intact;
}

// z = inverse r. A width that is known at compile time makes it several times faster.
template <int kWidth>
void MultiplySmall(const double* inverse, int width, const double* r, double* z) {
  const int w = kWidth > 0 ? kWidth : width;
  double sum[kWidth > 0 ? kWidth : kMaxWidth];
  for (int i = 0; i < w; ++i) sum[i] = inverse[i] * r[0];
  for (int j = 1; j < w; ++j) {
    for (int i = 0; i < w; ++i) sum[i] += inverse[j * w + i] * r[j];
  }
  for (int i = 0; i < w; ++i) z[i] = sum[i];
}

void MultiplySmall(const double* inverse, int width, const double* r, double* z) {
  switch (width) {
    case 4:
      return MultiplySmall<4>(inverse, width, r, z);
    case 6:
      return MultiplySmall<6>(inverse, width, r, z);
    case 7:
      return MultiplySmall<7>(inverse, width, r, z);
    case 8:
      return MultiplySmall<8>(inverse, width, r, z);
    case 9:
      return MultiplySmall<9>(inverse, width, r, z);
    default:
      return MultiplySmall<0>(inverse, width, r, z);
  }
}

}  // namespace

BlockJacobiPreconditioner::BlockJacobiPreconditioner(const BlockPattern& pattern, int num_threads)
    : pattern_(&pattern), num_threads_(num_threads) {
  size_t size = 0;
  inverse_begin_.reserve(pattern.widths.size());
  for (const int width : pattern.widths) {
    inverse_begin_.push_back(size);
    size += static_cast<size_t>(width) * width;
  }
  inverses_.assign(size, 0.0);
  repaired_.assign(pattern.widths.size(), 0);
}

void BlockJacobiPreconditioner::Set(const BlockMatrix& S) {
  HOLBA_CHECK(S.pattern->widths == pattern_->widths);
  const size_t num_nodes = pattern_->widths.size();
  ParallelTasks(num_threads_, NumTasks(num_nodes, kNodesPerTask), [&](size_t task) {
    const size_t end = std::min(num_nodes, (task + 1) * kNodesPerTask);
    for (size_t node = task * kNodesPerTask; node < end; ++node) {
      const double* block = S.Block(S.pattern->row_start[node + 1] - 1);
      repaired_[node] =
          !InvertBlock(block, pattern_->widths[node], inverses_.data() + inverse_begin_[node]);
    }
  });
}

void BlockJacobiPreconditioner::Apply(int begin, int end, const double* r, double* z) const {
  for (int node = begin; node < end; ++node) {
    const size_t offset = pattern_->offset[node];
    MultiplySmall(Inverse(node), pattern_->widths[node], r + offset, z + offset);
  }
}

void BlockJacobiPreconditioner::Apply(const double* r, double* z) {
  const size_t num_nodes = pattern_->widths.size();
  ParallelTasks(num_threads_, NumTasks(num_nodes, kNodesPerTask), [&](size_t task) {
    Apply(static_cast<int>(task * kNodesPerTask),
          static_cast<int>(std::min(num_nodes, (task + 1) * kNodesPerTask)), r, z);
  });
}

int BlockJacobiPreconditioner::num_repaired() const {
  return static_cast<int>(std::count(repaired_.begin(), repaired_.end(), 1));
}

BorderPreconditioner::BorderPreconditioner(const BlockPattern& pattern, int first_border_node,
                                           const BorderOptions& options, int num_threads)
    : pattern_(&pattern), num_threads_(num_threads), diagonal_(pattern, num_threads) {
  HOLBA_CHECK(first_border_node >= 0 && first_border_node <= pattern.num_nodes());
  ChooseCore(first_border_node, options);
  FindArms();
  BuildSchurPattern();
  GroupRows();
  if (core_.empty()) return;
  const double sparse_flops = core_pattern_.full ? 0.0 : PredictSparseFlops(core_pattern_);
  const bool sparse =
      !core_pattern_.full && sparse_flops < kSparseAdvantage * PredictDenseFlops(core_pattern_);
  solver_ = sparse ? MakeSparseSolver(core_pattern_, Precision::kDouble, num_threads)
                   : MakeDenseSolver(core_pattern_, Precision::kDouble, num_threads);
  set_flops_ += solver_->FactorFlops();
}

void BorderPreconditioner::ChooseCore(int first_border_node, const BorderOptions& options) {
  const int num_nodes = pattern_->num_nodes();
  std::vector<std::vector<int>> coupled(num_nodes - first_border_node);
  for (int a = first_border_node; a < num_nodes; ++a) {
    for (size_t k = pattern_->row_start[a]; k + 1 < pattern_->row_start[a + 1]; ++k) {
      const int b = pattern_->column[k];
      coupled[a - first_border_node].push_back(b);
      if (b >= first_border_node) coupled[b - first_border_node].push_back(a);
    }
  }
  std::vector<int> border(num_nodes - first_border_node);
  std::iota(border.begin(), border.end(), first_border_node);
  std::stable_sort(border.begin(), border.end(), [&](int a, int b) {
    return coupled[a - first_border_node].size() > coupled[b - first_border_node].size();
  });
  int num_unknowns = 0;
  double flops = 0.0;
  std::vector<int> core_unknowns(num_nodes, 0);  // that each node is coupled with
  for (const int node : border) {
    const int width = pattern_->widths[node];
    double node_flops = 0.0;
    for (const int other : coupled[node - first_border_node]) {
      node_flops +=
          2.0 * pattern_->widths[other] * PaddedWidth(width) * (core_unknowns[other] + width);
    }
    if (num_unknowns + width > options.max_core_unknowns ||
        flops + node_flops > options.max_schur_flops) {
      continue;
    }
    num_unknowns += width;
    flops += node_flops;
    for (const int other : coupled[node - first_border_node]) core_unknowns[other] += width;
    core_.push_back(node);
  }
  std::sort(core_.begin(), core_.end());
  core_of_node_.assign(num_nodes, -1);
  for (size_t core = 0; core < core_.size(); ++core) {
    core_of_node_[core_[core]] = static_cast<int>(core);
  }
}

void BorderPreconditioner::FindArms() {
  const int num_nodes = pattern_->num_nodes();
  // Rows and the columns in a row ascend, so the leaves of each core node do: first those before
  // it, then those after it.
  std::vector<std::vector<Arm>> arms_of_core(core_.size());
  for (int a = 0; a < num_nodes; ++a) {
    for (size_t k = pattern_->row_start[a]; k + 1 < pattern_->row_start[a + 1]; ++k) {
      const int b = pattern_->column[k];
      const int core_a = core_of_node_[a], core_b = core_of_node_[b];
      if (core_a >= 0 && core_b < 0) arms_of_core[core_a].push_back({core_a, b, k, false, 0});
      if (core_a < 0 && core_b >= 0) arms_of_core[core_b].push_back({core_b, a, k, true, 0});
    }
  }
  core_arms_.assign(1, 0);
  size_t values_size = 0;
  for (size_t core = 0; core < core_.size(); ++core) {
    const size_t padded = PaddedWidth(pattern_->widths[core_[core]]);
    for (Arm& arm : arms_of_core[core]) {
      arm.begin = values_size;
      values_size += padded * pattern_->widths[arm.leaf];
      arms_.push_back(arm);
    }
    for (size_t begin = core_arms_.back(); begin < arms_.size(); begin += kArmsPerChunk) {
      chunks_.push_back(
          {static_cast<int>(core), begin, std::min(arms_.size(), begin + kArmsPerChunk)});
    }
    core_arms_.push_back(arms_.size());
  }
  arm_values_ = AlignedDoubles(values_size);
  chunk_sums_.assign(chunks_.size() * kMaxWidth, 0.0);

  leaf_arms_begin_.assign(num_nodes + 1, 0);
  for (const Arm& arm : arms_) ++leaf_arms_begin_[arm.leaf + 1];
  std::partial_sum(leaf_arms_begin_.begin(), leaf_arms_begin_.end(), leaf_arms_begin_.begin());
  leaf_arms_.resize(arms_.size());
  std::vector<size_t> next(leaf_arms_begin_.begin(), leaf_arms_begin_.end() - 1);
  for (size_t arm = 0; arm < arms_.size(); ++arm) leaf_arms_[next[arms_[arm].leaf]++] = arm;
}

void BorderPreconditioner::BuildSchurPattern() {
  core_pattern_.row_start.assign(1, 0);
  std::vector<int> row;
  std::vector<int> last_row(core_.size(), -1);                 // in which a column was last put
  std::vector<int> core_unknowns(pattern_->widths.size(), 0);  // that each leaf is coupled with
  for (int core = 0; core < static_cast<int>(core_.size()); ++core) {
    const int node = core_[core];
    core_pattern_.widths.push_back(pattern_->widths[node]);
    row.clear();
    const auto put = [&](int column) {
      if (last_row[column] == core) return;
      last_row[column] = core;
      row.push_back(column);
    };
    for (size_t k = pattern_->row_start[node]; k < pattern_->row_start[node + 1]; ++k) {
      const int column = core_of_node_[pattern_->column[k]];
      if (column >= 0) put(column);
    }
    const double padded = PaddedWidth(pattern_->widths[node]);
    for (size_t arm = core_arms_[core]; arm < core_arms_[core + 1]; ++arm) {
      const int leaf = arms_[arm].leaf;
      const int leaf_width = pattern_->widths[leaf];
      core_unknowns[leaf] += pattern_->widths[node];
      set_flops_ += 2.0 * leaf_width * padded * (leaf_width + core_unknowns[leaf]);
      for (size_t l = leaf_arms_begin_[leaf]; l < leaf_arms_begin_[leaf + 1]; ++l) {
        const int other = arms_[leaf_arms_[l]].core;
        if (other > core || row.size() == static_cast<size_t>(core) + 1) break;
        put(other);
      }
    }
    std::sort(row.begin(), row.end());
    for (const int column : row) {
      core_pattern_.column.push_back(column);
      const size_t block = pattern_->Find(node, core_[column]);
      core_block_.push_back(block < pattern_->num_blocks() ? block : kNoBlock);
    }
    core_pattern_.row_start.push_back(core_pattern_.column.size());
  }
  core_pattern_.Finish();
  schur_ = BlockMatrix(&core_pattern_);
  core_r_.assign(core_pattern_.num_unknowns, 0.0);
  core_z_.assign(core_pattern_.num_unknowns, 0.0);
}

void BorderPreconditioner::GroupRows() {
  std::vector<int> found_by(pattern_->num_nodes(), -1);  // the last task whose leaf a node is
  for (int begin = 0, end; begin < static_cast<int>(core_.size()); begin = end) {
    int num_unknowns = 0;
    for (end = begin; end < static_cast<int>(core_.size()); ++end) {
      num_unknowns += core_pattern_.widths[end];
      if (end > begin && num_unknowns > kUnknownsPerTask) break;
    }
    Rows rows{begin, end, leaves_of_rows_.size(), 0};
    for (size_t a = core_arms_[begin]; a < core_arms_[end]; ++a) {
      const int leaf = arms_[a].leaf;
      if (found_by[leaf] == begin) continue;
      found_by[leaf] = begin;
      const auto core_below = [&](size_t arm, int core) { return arms_[arm].core < core; };
      const auto leaf_begin = leaf_arms_.begin() + leaf_arms_begin_[leaf];
      const auto leaf_end = leaf_arms_.begin() + leaf_arms_begin_[leaf + 1];
      const auto first = std::lower_bound(leaf_begin, leaf_end, begin, core_below);
      const auto last = std::lower_bound(first, leaf_end, end, core_below);
      leaves_of_rows_.push_back({leaf, static_cast<size_t>(first - leaf_arms_.begin()),
                                 static_cast<size_t>(last - leaf_arms_.begin())});
    }
    rows.leaves_end = leaves_of_rows_.size();
    // Ascending: in step with the order in memory.
    std::sort(leaves_of_rows_.begin() + rows.leaves_begin, leaves_of_rows_.end(),
              [](const LeafOfRows& a, const LeafOfRows& b) { return a.leaf < b.leaf; });
    rows_.push_back(rows);
  }
}

size_t BorderPreconditioner::MemoryBytes() const {
  return sizeof(double) * (arm_values_.size() + schur_.values.size()) + sizeof(Arm) * arms_.size() +
         sizeof(size_t) * leaf_arms_.size() + sizeof(LeafOfRows) * leaves_of_rows_.size() +
         diagonal_.MemoryBytes() + (solver_ ? solver_->MemoryBytes() : 0);
}

void BorderPreconditioner::MultiplyArms(const BlockMatrix& S, const Chunk& chunk) {
  const int padded = PaddedWidth(pattern_->widths[core_[chunk.core]]);
  const int core_width = pattern_->widths[core_[chunk.core]];
  std::array<double, kMaxWidth * kMaxWidth> transposed;
  for (size_t a = chunk.begin; a < chunk.end; ++a) {
    const Arm& arm = arms_[a];
    const int leaf_width = pattern_->widths[arm.leaf];
    const double* block = S.Block(arm.block);
    if (arm.transposed) {
      const int leaf_padded = PaddedWidth(leaf_width);
      for (int k = 0; k < leaf_width; ++k) {
        for (int i = 0; i < core_width; ++i) {
          transposed[k * padded + i] = block[i * leaf_padded + k];
        }
      }
      block = transposed.data();
    }
    const double* inverse = diagonal_.Inverse(arm.leaf);
    double* product = arm_values_.data() + arm.begin;
    for (int j = 0; j < leaf_width; ++j) {
      double* column = product + j * padded;
      for (int i = 0; i < core_width; ++i) column[i] = 0.0;
      for (int k = 0; k < leaf_width; ++k) {
        const double factor = inverse[j * leaf_width + k];
        for (int i = 0; i < core_width; ++i) column[i] += block[k * padded + i] * factor;
      }
    }
  }
}

void BorderPreconditioner::ComputeSchurRows(const BlockMatrix& S, size_t task) {
  const auto subtract_product = HOLBA_SIMD_CHOOSE(SubtractProduct);
  const Rows& rows = rows_[task];
  for (size_t k = core_pattern_.row_start[rows.begin]; k < core_pattern_.row_start[rows.end]; ++k) {
    double* block = schur_.Block(k);
    double* block_end = k + 1 < core_pattern_.num_blocks()
                            ? schur_.Block(k + 1)
                            : schur_.values.data() + schur_.values.size();
    if (core_block_[k] == kNoBlock) {
      std::fill(block, block_end, 0.0);
    } else {
      std::copy_n(S.Block(core_block_[k]), block_end - block, block);
    }
  }
  const auto column_begin = core_pattern_.column.begin();
  for (size_t i = rows.leaves_begin; i < rows.leaves_end; ++i) {
    const LeafOfRows& shared = leaves_of_rows_[i];
    const int leaf_width = pattern_->widths[shared.leaf];
    for (size_t l = leaf_arms_begin_[shared.leaf]; l < shared.end; ++l) {
      const Arm& other = arms_[leaf_arms_[l]];
      const int other_width = core_pattern_.widths[other.core];
      const double* other_block = S.Block(other.block);
      const size_t row_stride = other.transposed ? PaddedWidth(leaf_width) : 1;
      const size_t column_stride = other.transposed ? 1 : PaddedWidth(other_width);
      for (size_t m = std::max(l, shared.begin); m < shared.end; ++m) {
        const Arm& arm = arms_[leaf_arms_[m]];
        const size_t row_begin = core_pattern_.row_start[arm.core];
        const size_t row_end = core_pattern_.row_start[arm.core + 1];
        const size_t k = core_pattern_.full ? row_begin + other.core
                                            : std::lower_bound(column_begin + row_begin,
                                                               column_begin + row_end, other.core) -
                                                  column_begin;
        subtract_product(PaddedWidth(core_pattern_.widths[arm.core]), leaf_width, other_width,
                         arm_values_.data() + arm.begin, other_block, row_stride, column_stride,
                         schur_.Block(k));
      }
    }
  }
  for (int core = rows.begin; core < rows.end; ++core) {
    double* diagonal = schur_.Block(core_pattern_.row_start[core + 1] - 1);
    const int width = core_pattern_.widths[core], padded = PaddedWidth(width);
    for (int j = 0; j < width; ++j) {
      for (int i = j + 1; i < width; ++i) diagonal[i * padded + j] = diagonal[j * padded + i];
    }
  }
}

bool BorderPreconditioner::FactoriseSchur(const BlockMatrix& S) {
  // Squares of the factors of E that are tried. The complement of each is a combination of the one
  // before and C, so that no second copy is needed.
  constexpr double kSquaredCouplings[] = {1.0, 0.9, 0.5, 0.0};
  double squared = 1.0;
  for (const double next : kSquaredCouplings) {
    if (next < squared) {
      const double kept = next / squared;
      ParallelTasks(num_threads_, core_.size(), [&](size_t core) {
        const int padded = PaddedWidth(core_pattern_.widths[core]);
        for (size_t k = core_pattern_.row_start[core]; k < core_pattern_.row_start[core + 1]; ++k) {
          const size_t size =
              static_cast<size_t>(padded) * core_pattern_.widths[core_pattern_.column[k]];
          double* block = schur_.Block(k);
          const double* whole = core_block_[k] == kNoBlock ? nullptr : S.Block(core_block_[k]);
          for (size_t i = 0; i < size; ++i) {
            // At 0 nothing of the block before remains, even if it was not finite.
            const double from_block = kept > 0.0 ? kept * block[i] : 0.0;
            block[i] = from_block + (whole != nullptr ? (1.0 - kept) * whole[i] : 0.0);
          }
        }
      });
      squared = next;
    }
    if (solver_->Factorise(schur_)) {
      coupling_ = std::sqrt(squared);
      return true;
    }
  }
  return false;
}

void BorderPreconditioner::Set(const BlockMatrix& S) {
  HOLBA_CHECK(S.pattern->num_blocks() == pattern_->num_blocks());
  diagonal_.Set(S);
  coupling_ = 0.0;
  core_solved_ = false;
  if (core_.empty()) return;
  ParallelTasks(num_threads_, chunks_.size(),
                [&](size_t chunk) { MultiplyArms(S, chunks_[chunk]); });
  ParallelTasks(num_threads_, rows_.size(), [&](size_t task) { ComputeSchurRows(S, task); });
  core_solved_ = FactoriseSchur(S);
}

void BorderPreconditioner::Apply(const double* r, double* z) {
  if (core_solved_) {
    ReduceToCore(r);
    // A complement so close to singular that the solution overflows is as useless as an indefinite
    // one.
    core_solved_ = solver_->Solve(core_r_.data(), core_z_.data());
    if (!core_solved_) coupling_ = 0.0;
  }
  if (core_solved_) {
    SubstituteToLeaves(r, z);
  } else {
    diagonal_.Apply(r, z);
  }
}

// core_r_ = r_C - E^T D^-1 r_D.
void BorderPreconditioner::ReduceToCore(const double* r) {
  for (size_t core = 0; core < core_.size(); ++core) {
    std::copy_n(r + pattern_->offset[core_[core]], core_pattern_.widths[core],
                core_r_.data() + core_pattern_.offset[core]);
  }
  if (!(coupling_ > 0.0)) return;
  ParallelTasks(num_threads_, chunks_.size(), [&](size_t c) {
    const Chunk& chunk = chunks_[c];
    const int width = core_pattern_.widths[chunk.core], padded = PaddedWidth(width);
    double sums[kMaxWidth] = {};
    for (size_t a = chunk.begin; a < chunk.end; ++a) {
      const double* column = arm_values_.data() + arms_[a].begin;
      const double* r_leaf = r + pattern_->offset[arms_[a].leaf];
      for (int j = 0; j < pattern_->widths[arms_[a].leaf]; ++j, column += padded) {
        for (int i = 0; i < width; ++i) sums[i] += column[i] * r_leaf[j];
      }
    }
    std::copy_n(sums, width, chunk_sums_.data() + c * kMaxWidth);
  });
  for (size_t c = 0; c < chunks_.size(); ++c) {
    double* core_r = core_r_.data() + core_pattern_.offset[chunks_[c].core];
    for (int i = 0; i < core_pattern_.widths[chunks_[c].core]; ++i) {
      core_r[i] -= coupling_ * chunk_sums_[c * kMaxWidth + i];
    }
  }
}

// z_C = core_z_, z_D = D^-1 r_D - D^-1 E z_C.
void BorderPreconditioner::SubstituteToLeaves(const double* r, double* z) const {
  const size_t num_nodes = pattern_->widths.size();
  ParallelTasks(num_threads_, NumTasks(num_nodes, kNodesPerTask), [&](size_t task) {
    const int end = static_cast<int>(std::min(num_nodes, (task + 1) * kNodesPerTask));
    for (int node = static_cast<int>(task * kNodesPerTask); node < end; ++node) {
      double* z_node = z + pattern_->offset[node];
      const int width = pattern_->widths[node];
      if (core_of_node_[node] >= 0) {
        std::copy_n(core_z_.data() + core_pattern_.offset[core_of_node_[node]], width, z_node);
        continue;
      }
      diagonal_.Apply(node, node + 1, r, z);
      if (coupling_ == 0.0) continue;
      for (size_t l = leaf_arms_begin_[node]; l < leaf_arms_begin_[node + 1]; ++l) {
        const Arm& arm = arms_[leaf_arms_[l]];
        const int core_width = core_pattern_.widths[arm.core], padded = PaddedWidth(core_width);
        const double* core_z = core_z_.data() + core_pattern_.offset[arm.core];
        const double* column = arm_values_.data() + arm.begin;
        for (int j = 0; j < width; ++j, column += padded) {
          double sum = 0.0;
          for (int i = 0; i < core_width; ++i) sum += column[i] * core_z[i];
          z_node[j] -= coupling_ * sum;
        }
      }
    }
  });
}

PowerSeriesPreconditioner::PowerSeriesPreconditioner(Preconditioner* u_inverse, LinearOperator* e,
                                                     size_t num_unknowns, int order)
    : u_inverse_(u_inverse), e_(e), order_(order), term_(num_unknowns), product_(num_unknowns) {
  HOLBA_CHECK(order >= 0);
}

void PowerSeriesPreconditioner::Apply(const double* r, double* z) {
  u_inverse_->Apply(r, term_.data());
  std::copy(term_.begin(), term_.end(), z);
  for (int i = 0; i < order_; ++i) {
    e_->Apply(term_.data(), product_.data());
    u_inverse_->Apply(product_.data(), term_.data());
    for (size_t k = 0; k < term_.size(); ++k) z[k] += term_[k];
  }
}

}  // namespace holba
