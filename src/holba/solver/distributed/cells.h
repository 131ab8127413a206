// SPDX-License-Identifier: BSD-3-Clause
// The rows and columns of a reduced system that is spread over parts, and what each part adds to
// it. Needs no communication: a simulation of many parts uses it as well.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "holba/problem/problem.h"
#include "holba/solver/distributed/partition.h"
#include "holba/solver/native/normal_equations.h"

namespace holba::distributed {

// A cell has the unknowns of a pose, with its intrinsics where no other pose shares any intrinsics,
// or those of another kept block. Its width is padded to a multiple of the block size, which is the
// width of a cell of a pose, so that the whole matrix has blocks of one size; padding has ones on
// the diagonal. A part without any cell has one of padding. Cells are numbered part by part: poses
// first, then other blocks, and at the end of the last part the border (Partition::is_border). A
// matrix of which the upper triangle is stored then has the couplings with the border in the rows
// of the poses, each in the part of its pose.
struct CellLayout {
  static constexpr uint32_t kNoCell = ~uint32_t{0};

  struct Place {
    uint32_t cell = kNoCell;  // kNoCell: not kept, not variable, or not held by any residual
    int first = 0;            // column of its first unknown in the cell
  };

  int block_size = 1;
  std::vector<Place> place;             // by block
  std::vector<uint32_t> columns;        // by block: bit t: tangent coordinate t is an unknown
  std::vector<int> width, padded;       // by cell: unknowns, and with padding
  std::vector<size_t> begin;            // by cell: its first unknown; one entry more than cells
  std::vector<int32_t> part;            // by cell
  std::vector<uint32_t> first_of_part;  // one entry more than there are parts
  std::vector<uint8_t> free;            // by unknown: whether it may move: no padding, not held

  size_t num_cells() const { return width.size(); }
  size_t num_unknowns() const { return begin.back(); }
  // Cells of the border, which are the last ones.
  size_t num_border_cells = 0;
};

CellLayout MakeCellLayout(const Problem& problem, const Partition& partition);

// A dense block of the reduced system: the entries of cells row <= column, row by row.
struct CellPair {
  uint32_t row = 0, column = 0;
  bool operator==(const CellPair&) const = default;
  auto operator<=>(const CellPair&) const = default;
};

// What one part adds to the reduced system: blocks of pairs of cells, each sent to the part that
// owns the row, and vectors of cells, each sent to the part that owns the cell.
class Contribution {
 public:
  // `structure` and `pattern` are those of the part's NormalEquations, in explicit form.
  // `block_of_whole`: PartProblem.
  Contribution(const native::Structure& structure, const BlockPattern& pattern,
               const std::vector<BlockId>& block_of_whole, const CellLayout& layout);

  // Sorted by the part that they go to, then by row and column.
  const std::vector<CellPair>& pairs() const { return pairs_; }
  const std::vector<size_t>& pair_offset() const { return pair_offset_; }  // into packed blocks
  // Ascending, which is also by the part that they go to.
  const std::vector<uint32_t>& cells() const { return cells_; }
  const std::vector<size_t>& cell_offset() const { return cell_offset_; }  // into packed vectors

  // Ranges of the above for each part: one entry more than there are parts.
  std::vector<size_t> pairs_of_part, cells_of_part;

  // Entries of S in the order of pairs().
  void PackBlocks(const BlockMatrix& S, std::vector<double>* out) const;
  // A padded vector of the equations in the order of cells().
  void PackVector(const double* padded, double* out) const;
  // The opposite: from the order of cells() to a plain vector of the pattern.
  void UnpackVector(const double* packed, double* plain) const;

 private:
  struct Piece {  // the columns of a kept block, in a node and in its cell
    uint32_t cell = 0;
    std::vector<std::pair<int, int>> columns;  // in the node, in the cell
  };
  struct Copy {
    uint32_t block = 0;  // of the pattern
    uint32_t row_piece = 0, column_piece = 0;
    bool transposed = false;  // the row piece belongs to the node of the block's columns
    bool mirrored = false;    // both triangles of a diagonal block of cells
    size_t offset = 0;        // of the pair in the packed blocks
  };
  void FindPieces(const native::Structure& structure, const std::vector<BlockId>& block_of_whole,
                  const CellLayout& layout);
  void FindCells(const CellLayout& layout);
  void FindPairs(const BlockPattern& pattern, const CellLayout& layout);

  std::vector<Piece> pieces_;
  std::vector<uint32_t> first_piece_;               // by node; one entry more
  std::vector<size_t> padded_begin_, plain_begin_;  // by node
  std::vector<CellPair> pairs_;
  std::vector<size_t> pair_offset_;
  std::vector<int> column_width_;  // by pair: padded width of its column
  std::vector<uint32_t> cells_;
  std::vector<size_t> cell_offset_, offset_of_piece_;
  std::vector<Copy> copies_;
  std::vector<int> stride_of_copy_;
};

}  // namespace holba::distributed
