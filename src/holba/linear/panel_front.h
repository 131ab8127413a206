// SPDX-License-Identifier: BSD-3-Clause
// Front: a dense symmetric matrix of which the first columns are eliminated by Cholesky:
//   [A11 .; A21 A22] -> L11, L21 with A11 = L11 L11^T, A21 = L21 L11^T, and A22 - L21 L21^T.
// A dense matrix is a front with no remaining rows; a sparse factor is a tree of fronts.
//
// A front is stored in row panels (panel_kernels.h): `factor` has the panels of the eliminated
// columns, of which those of the triangle L11 end at the diagonal; `update` has the lower triangle
// of the remaining part. The work is cut into tiles that do not depend on the number of threads. A
// tile subtracts products in the order of their columns, so results repeat bit for bit.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "holba/linear/panel_kernels.h"

namespace holba {

// n rounded up to whole panels.
template <typename Real>
constexpr int PadToPanels(int n) {
  return (n + kPanelRows<Real> - 1) / kPanelRows<Real> * kPanelRows<Real>;
}

template <typename Real>
struct PanelFront {
  static constexpr int kRows = kPanelRows<Real>;

  int eliminated = 0;  // columns, a multiple of kRows
  int remaining = 0;   // rows below, a multiple of kRows
  Real* factor = nullptr;
  Real* update = nullptr;
  Real* inverse_diagonal = nullptr;  // reciprocals of the diagonal of L11

  // Entries before row panel r of a lower triangle that is `columns` wide at most.
  static size_t TrapezoidSize(size_t r, size_t columns) {
    const size_t triangle = r < columns / kRows ? r : columns / kRows;
    return kRows * (kRows * triangle * (triangle + 1) / 2 + (r - triangle) * columns);
  }
  static size_t FactorSize(int eliminated, int remaining) {
    return TrapezoidSize((eliminated + remaining) / kRows, eliminated);
  }
  static size_t UpdateSize(int remaining) { return TrapezoidSize(remaining / kRows, remaining); }

  int num_eliminated_panels() const { return eliminated / kRows; }
  int num_panels() const { return (eliminated + remaining) / kRows; }
  Real* FactorPanel(int r) const { return factor + TrapezoidSize(r, eliminated); }
  // r counts from the first remaining row.
  Real* UpdatePanel(int r) const { return update + TrapezoidSize(r, remaining); }
};

// How the elimination of a front is cut into tiles.
class FrontTiling {
 public:
  FrontTiling() = default;
  // tile_size: a multiple of 48.
  FrontTiling(int eliminated, int remaining, int tile_size);
  // A good tile size for a front that is worked on by several threads.
  static int TileSize(int eliminated, int remaining);

  int num_rows() const { return num_eliminated_ + num_remaining_; }
  int num_tiles() const { return num_rows() * (num_rows() + 1) / 2; }
  int num_eliminated() const { return num_eliminated_; }
  int tile_size() const { return tile_size_; }
  // Rows of the front (also columns) of tile row t, [Begin(t), End(t)).
  int Begin(int t) const {
    return t < num_eliminated_ ? t * tile_size_ : eliminated_ + (t - num_eliminated_) * tile_size_;
  }
  int End(int t) const;

  struct Tile {
    int row, column;
  };
  // Tiles column by column: an order in which each depends on earlier ones only.
  Tile TileAt(int index) const;
  int Index(int row, int column) const {
    return column * num_rows() - column * (column - 1) / 2 + row - column;
  }

 private:
  int eliminated_ = 0, remaining_ = 0, tile_size_ = 0;
  int num_eliminated_ = 0, num_remaining_ = 0;
};

// Does the work of one tile after waiting for the tiles that it reads: a tile is finished when its
// entry of `done` holds `round`, which this call sets for its own tile. A null `done` means that
// one thread runs the tiles in order. A pivot not above min_pivot sets *failed; later tiles then do
// nothing.
template <typename Real>
void EliminateTile(const PanelFront<Real>& front, const FrontTiling& tiling, int index,
                   Real min_pivot, std::atomic<uint32_t>* done, uint32_t round,
                   std::atomic<bool>* failed);

// The whole elimination on one thread. False: a pivot was not above min_pivot.
template <typename Real>
bool EliminateFront(const PanelFront<Real>& front, const FrontTiling& tiling, Real min_pivot);

// Solves L11 y1 = b1 and subtracts L21 y1 from b2, in place; x: eliminated + remaining entries.
template <typename Real>
void SolveForward(const PanelFront<Real>& front, Real* x, int num_threads);

// Solves L11^T x1 = y1 - L21^T x2, in place; x: eliminated + remaining entries. lanes: work space
// of eliminated * kPanelRows.
template <typename Real>
void SolveBackward(const PanelFront<Real>& front, Real* x, Real* lanes, int num_threads);

}  // namespace holba
