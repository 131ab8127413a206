// SPDX-License-Identifier: BSD-3-Clause
// Symmetric matrices of small dense blocks, such as the reduced system; the lower triangle is
// stored.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <new>
#include <vector>

#include "holba/linear/padding.h"

namespace holba {

// Which blocks a matrix has. A node is a set of unknowns (a pose, the intrinsics of a camera).
struct BlockPattern {
  static constexpr int kMaxWidth = kMaxBlockWidth;

  std::vector<int> widths;        // unknowns of each node, 1 .. kMaxWidth
  std::vector<size_t> row_start;  // row a has the blocks row_start[a] .. row_start[a + 1] - 1
  std::vector<int> column;        // of each block: ascending in a row, the last one the row itself
  // Derived from the above by Finish():
  std::vector<size_t> offset;  // of each node's unknowns in plain vectors, and num_unknowns
  size_t num_unknowns = 0;
  bool full = false;  // the pattern has every block of the lower triangle

  int num_nodes() const { return static_cast<int>(widths.size()); }
  size_t num_blocks() const { return column.size(); }
  // Index of block (a, b), a >= b; num_blocks() if the pattern does not have it.
  size_t Find(int a, int b) const;

  // Must be called after widths, row_start and column are filled; CHECKs that they are valid.
  void Finish();
};

// Doubles at a multiple of 64 bytes. Some doubles on either side may be read; their values mean
// nothing.
class AlignedDoubles {
 public:
  AlignedDoubles() = default;
  explicit AlignedDoubles(size_t size);
  AlignedDoubles(AlignedDoubles&& other) noexcept;
  AlignedDoubles& operator=(AlignedDoubles&& other) noexcept;
  ~AlignedDoubles();

  double* data() { return data_; }
  const double* data() const { return data_; }
  size_t size() const { return size_; }

 private:
  double* data_ = nullptr;
  size_t size_ = 0;
};

// Block (a, b), a >= b, is stored column by column: widths[b] columns of PaddedWidth(widths[a])
// doubles. The padding is never used. A diagonal block is stored with both triangles.
struct BlockMatrix {
  BlockMatrix() = default;
  // All zero. `pattern` must outlive the matrix.
  explicit BlockMatrix(const BlockPattern* pattern);

  const BlockPattern* pattern = nullptr;
  std::vector<size_t> block_offset;  // of each block in values, multiples of 8
  AlignedDoubles values;

  double* Block(size_t k) { return values.data() + block_offset[k]; }
  const double* Block(size_t k) const { return values.data() + block_offset[k]; }

  void SetZero(int num_threads = 1);

  // y = S x, plain vectors of num_unknowns that do not overlap. The result does not depend on the
  // number of threads. `scratch` keeps its memory from call to call; after ReserveScratch not even
  // the first call allocates.
  void Multiply(const double* x, double* y, int num_threads, std::vector<double>* scratch) const;
  static void ReserveScratch(const BlockPattern& pattern, std::vector<double>* scratch);

  // Both triangles; for tests and small problems.
  Eigen::MatrixXd ToDense() const;
};

}  // namespace holba
