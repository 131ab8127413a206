// SPDX-License-Identifier: BSD-3-Clause
// Symmetric matrices of small dense blocks, lower triangle stored: the reduced camera system.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <new>
#include <vector>

#include "holba/linear/padding.h"

namespace holba {

// Which blocks there are. A node is a group of unknowns (a pose, the intrinsics of a camera).
struct BlockPattern {
  static constexpr int kMaxWidth = kMaxBlockWidth;

  std::vector<int> widths;        // unknowns of each node, 1 .. kMaxWidth
  std::vector<size_t> row_start;  // row a has the blocks row_start[a] .. row_start[a + 1] - 1
  std::vector<int> column;        // of each block: ascending in a row, the last one the row itself
  // Derived from the above by Finish():
  std::vector<size_t> offset;  // of each node's unknowns in plain vectors, and num_unknowns
  size_t num_unknowns = 0;
  bool full = false;  // every block of the lower triangle is there

  int num_nodes() const { return static_cast<int>(widths.size()); }
  size_t num_blocks() const { return column.size(); }
  // Block (a, b), a >= b; num_blocks() if it is not there.
  size_t Find(int a, int b) const;

  // To be called once widths, row_start and column are filled; CHECKs what they promise.
  void Finish();
};

// Doubles at a multiple of 64 bytes, with some on either side that may be read and mean nothing.
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

// Block (a, b), a >= b, lies column by column: widths[b] columns of PaddedWidth(widths[a]) doubles;
// what is in the padding is never used. A diagonal block is stored whole, both triangles.
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

  // y = S x, plain vectors of num_unknowns; x and y are apart. The result does not depend on the
  // number of threads. `scratch` keeps its memory from call to call (ReserveScratch: from the
  // first).
  void Multiply(const double* x, double* y, int num_threads, std::vector<double>* scratch) const;
  static void ReserveScratch(const BlockPattern& pattern, std::vector<double>* scratch);

  // Both triangles; for tests and small problems.
  Eigen::MatrixXd ToDense() const;
};

}  // namespace holba
