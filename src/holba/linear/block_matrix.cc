// SPDX-License-Identifier: BSD-3-Clause
#include "holba/linear/block_matrix.h"

#include <algorithm>
#include <cstring>
#include <utility>

#include "holba/base/check.h"
#include "holba/base/threads.h"
#include "holba/linear/alignment.h"
#include "holba/linear/block_kernels.h"

namespace holba {

size_t BlockPattern::Find(int a, int b) const {
  if (full) return row_start[a] + b;
  const auto begin = column.begin() + row_start[a];
  const auto end = column.begin() + row_start[a + 1];
  const auto it = std::lower_bound(begin, end, b);
  return it != end && *it == b ? it - column.begin() : num_blocks();
}

void BlockPattern::Finish() {
  const size_t n = widths.size();
  HOLBA_CHECK(row_start.size() == n + 1 && row_start[0] == 0 && row_start[n] == column.size());
  offset.assign(n + 1, 0);
  for (size_t a = 0; a < n; ++a) {
    HOLBA_CHECK(widths[a] >= 1 && widths[a] <= kMaxWidth);
    HOLBA_CHECK(row_start[a] < row_start[a + 1]);
    HOLBA_CHECK(column[row_start[a]] >= 0);
    HOLBA_CHECK(column[row_start[a + 1] - 1] == static_cast<int>(a));
    for (size_t k = row_start[a] + 1; k < row_start[a + 1]; ++k) {
      HOLBA_CHECK(column[k - 1] < column[k]);
    }
    offset[a + 1] = offset[a] + widths[a];
  }
  num_unknowns = offset[n];
  full = column.size() == n * (n + 1) / 2;
}

namespace {

// The product: rows are cut into chunks of about equal work, each with a y of its own.
constexpr size_t kChunkValues = 1 << 16;
constexpr size_t kMaxChunks = 16;

// A row is read and written in whole registers: a margin behind each part.
size_t ScratchStride(const BlockPattern& pattern) {
  return (pattern.num_unknowns + BlockPattern::kMaxWidth + 7) / 8 * 8;
}

constexpr size_t kSlack = 16;  // kernels read whole registers that begin inside
}  // namespace

AlignedDoubles::AlignedDoubles(size_t size) : size_(size) {
  data_ =
      static_cast<double*>(::operator new((size + 2 * kSlack) * sizeof(double), kMatrixAlignment)) +
      kSlack;
  std::fill_n(data_ - kSlack, kSlack, 0.0);
  std::fill_n(data_ + size, kSlack, 0.0);
}
AlignedDoubles::AlignedDoubles(AlignedDoubles&& other) noexcept
    : data_(std::exchange(other.data_, nullptr)), size_(std::exchange(other.size_, 0)) {}
AlignedDoubles& AlignedDoubles::operator=(AlignedDoubles&& other) noexcept {
  std::swap(data_, other.data_);
  std::swap(size_, other.size_);
  return *this;
}
AlignedDoubles::~AlignedDoubles() {
  if (data_ != nullptr) ::operator delete(data_ - kSlack, kMatrixAlignment);
}

BlockMatrix::BlockMatrix(const BlockPattern* pattern) : pattern(pattern) {
  HOLBA_CHECK(pattern->offset.size() == pattern->widths.size() + 1);
  block_offset.resize(pattern->num_blocks());
  size_t size = 0;
  for (int a = 0; a < pattern->num_nodes(); ++a) {
    const size_t height = PaddedWidth(pattern->widths[a]);
    for (size_t k = pattern->row_start[a]; k < pattern->row_start[a + 1]; ++k) {
      block_offset[k] = size;
      size += height * pattern->widths[pattern->column[k]];
    }
  }
  values = AlignedDoubles(size);
  SetZero();
}

void BlockMatrix::SetZero(int num_threads) {
  ParallelFor(num_threads, values.size(), [&](size_t begin, size_t end) {
    std::memset(values.data() + begin, 0, (end - begin) * sizeof(double));
  });
}

void BlockMatrix::ReserveScratch(const BlockPattern& pattern, std::vector<double>* scratch) {
  scratch->reserve(ScratchStride(pattern) * (kMaxChunks + 1));
}

void BlockMatrix::Multiply(const double* x, double* y, int num_threads,
                           std::vector<double>* scratch) const {
  // Each block serves its row and, transposed, its column. What the chunks of rows give is added up
  // in order; the chunks depend on the matrix only.
  const BlockPattern& p = *pattern;
  const size_t n = p.num_unknowns;
  const size_t num_chunks = std::clamp<size_t>(values.size() / kChunkValues, 1, kMaxChunks);
  const auto chunk_begin = [&](size_t chunk) -> int {
    if (chunk == 0) return 0;
    if (chunk == num_chunks) return p.num_nodes();
    const size_t wanted = values.size() / num_chunks * chunk;
    const auto it = std::lower_bound(
        p.row_start.begin(), p.row_start.end(), wanted, [&](size_t block, size_t value) {
          return (block < block_offset.size() ? block_offset[block] : values.size()) < value;
        });
    return std::min<int>(it - p.row_start.begin(), p.num_nodes());
  };
  const size_t stride = ScratchStride(p);
  scratch->resize(stride * (num_chunks + 1));
  double* padded_x = scratch->data() + stride * num_chunks;
  std::copy_n(x, n, padded_x);
  std::fill(padded_x + n, padded_x + stride, 0.0);
  const auto kernel = CurrentBlockRowKernel();
  ParallelTasks(num_threads, num_chunks, [&](size_t chunk) {
    double* own_y = scratch->data() + stride * chunk;
    const int begin = chunk_begin(chunk);
    const int end = chunk_begin(chunk + 1);
    std::fill_n(own_y, p.offset[end] + (stride - n), 0.0);
    for (int a = begin; a < end; ++a) {
      const size_t first = p.row_start[a];
      kernel(static_cast<int>(p.row_start[a + 1] - first), p.widths[a], p.column.data() + first,
             p.widths.data(), p.offset.data(), block_offset.data() + first, values.data(), padded_x,
             own_y);
    }
  });
  ParallelFor(num_threads, n, [&](size_t begin, size_t end) {
    std::fill(y + begin, y + end, 0.0);
    for (size_t chunk = 0; chunk < num_chunks; ++chunk) {
      const double* own_y = scratch->data() + stride * chunk;
      const size_t stop = std::min(end, p.offset[chunk_begin(chunk + 1)]);
      for (size_t i = begin; i < stop; ++i) y[i] += own_y[i];
    }
  });
}

Eigen::MatrixXd BlockMatrix::ToDense() const {
  const BlockPattern& p = *pattern;
  Eigen::MatrixXd dense = Eigen::MatrixXd::Zero(p.num_unknowns, p.num_unknowns);
  for (int a = 0; a < p.num_nodes(); ++a) {
    const int stride = PaddedWidth(p.widths[a]);
    for (size_t k = p.row_start[a]; k < p.row_start[a + 1]; ++k) {
      const int b = p.column[k];
      const Eigen::Map<const Eigen::MatrixXd, 0, Eigen::OuterStride<>> block(
          Block(k), p.widths[a], p.widths[b], Eigen::OuterStride<>(stride));
      dense.block(p.offset[a], p.offset[b], p.widths[a], p.widths[b]) = block;
      dense.block(p.offset[b], p.offset[a], p.widths[b], p.widths[a]) = block.transpose();
    }
  }
  return dense;
}

}  // namespace holba
