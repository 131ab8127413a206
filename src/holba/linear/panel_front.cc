// SPDX-License-Identifier: BSD-3-Clause
#include "holba/linear/panel_front.h"

#include <algorithm>
#include <cmath>

#include "holba/base/check.h"
#include "holba/base/threads.h"

namespace holba {
namespace {

// The largest tile: its panel pointers fit the arrays below.
constexpr int kMaxTileSize = 384;
// Columns of a step of the triangular solves.
constexpr int kSolveColumns = 192;
// A step of the triangular solves below this many entries is not worth a second thread.
constexpr size_t kMinSharedEntries = 1 << 16;

void WaitFor(const std::atomic<uint32_t>* done, int index, uint32_t round) {
  if (done == nullptr) return;
  for (int step = 0; done[index].load(std::memory_order_acquire) != round; ++step) SpinWait(step);
}

}  // namespace

FrontTiling::FrontTiling(int eliminated, int remaining, int tile_size)
    : eliminated_(eliminated),
      remaining_(remaining),
      tile_size_(tile_size),
      num_eliminated_((eliminated + tile_size - 1) / tile_size),
      num_remaining_((remaining + tile_size - 1) / tile_size) {
  HOLBA_CHECK(tile_size > 0 && tile_size % 48 == 0 && tile_size <= kMaxTileSize);
}

int FrontTiling::TileSize(int eliminated, int remaining) {
  // Small enough that there are tiles for several threads; beyond that, flat in the size.
  const int n = eliminated + remaining;
  return n < 600 ? 96 : n < 2000 ? 144 : 192;
}

int FrontTiling::End(int t) const {
  return std::min(Begin(t) + tile_size_,
                  t < num_eliminated_ ? eliminated_ : eliminated_ + remaining_);
}

FrontTiling::Tile FrontTiling::TileAt(int index) const {
  // The largest column with Index(column, column) <= index, from the root of the quadratic.
  const double n = num_rows() + 0.5;
  int column = static_cast<int>(n - std::sqrt(std::max(0.0, n * n - 2.0 * index)));
  column = std::clamp(column, 0, num_rows() - 1);
  while (column > 0 && Index(column, column) > index) --column;
  while (column + 1 < num_rows() && Index(column + 1, column + 1) <= index) ++column;
  return {column + index - Index(column, column), column};
}

template <typename Real>
void EliminateTile(const PanelFront<Real>& front, const FrontTiling& tiling, int index,
                   Real min_pivot, std::atomic<uint32_t>* done, uint32_t round,
                   std::atomic<bool>* failed) {
  constexpr int kRows = kPanelRows<Real>;
  constexpr int kMaxPanels = kMaxTileSize / kRows;
  constexpr int kMaxGroups = kMaxTileSize / kGroupColumns;
  const PanelKernels<Real>& kernels = CurrentPanelKernels<Real>();
  const auto [row, column] = tiling.TileAt(index);
  const bool of_factor = column < tiling.num_eliminated();
  const int row_begin = tiling.Begin(row), row_end = tiling.End(row);
  const int column_begin = tiling.Begin(column), column_end = tiling.End(column);
  const int num_panels = (row_end - row_begin) / kRows;
  const int num_groups = (column_end - column_begin) / kGroupColumns;

  Real* own[kMaxPanels];   // factor panels of the tile's rows
  Real* into[kMaxPanels];  // where the tile is
  for (int p = 0; p < num_panels; ++p) {
    const int r = row_begin / kRows + p;
    own[p] = front.FactorPanel(r);
    into[p] = of_factor ? own[p] + static_cast<size_t>(column_begin) * kRows
                        : front.UpdatePanel(r - front.num_eliminated_panels()) +
                              static_cast<size_t>(column_begin - front.eliminated) * kRows;
  }
  Real* other[kMaxGroups];  // the rows of the factor that belong to the tile's columns
  for (int g = 0; g < num_groups; ++g) {
    const int line = column_begin + g * kGroupColumns;
    other[g] = front.FactorPanel(line / kRows) + line % kRows;
  }

  const int num_products = std::min(column, tiling.num_eliminated());
  for (int t = 0; t < num_products; ++t) {
    WaitFor(done, tiling.Index(row, t), round);
    WaitFor(done, tiling.Index(column, t), round);
    if (failed->load(std::memory_order_relaxed)) break;
    const Real* a[kMaxPanels];
    const Real* b[kMaxGroups];
    const size_t from = static_cast<size_t>(tiling.Begin(t)) * kRows;
    for (int p = 0; p < num_panels; ++p) a[p] = own[p] + from;
    for (int g = 0; g < num_groups; ++g) b[g] = other[g] + from;
    kernels.update(num_panels, a, into, num_groups, b, tiling.End(t) - tiling.Begin(t),
                   row == column);
  }
  if (of_factor) {
    Real* inverse = front.inverse_diagonal + column_begin;
    if (row == column) {
      if (!failed->load(std::memory_order_relaxed) &&
          !kernels.factorise(num_panels, into, num_groups, min_pivot, inverse)) {
        failed->store(true, std::memory_order_relaxed);
      }
    } else {
      WaitFor(done, tiling.Index(column, column), round);
      if (!failed->load(std::memory_order_relaxed)) {
        const Real* diagonal[kMaxPanels];
        for (int p = 0; p < (column_end - column_begin) / kRows; ++p) {
          diagonal[p] = front.FactorPanel(column_begin / kRows + p) +
                        static_cast<size_t>(column_begin) * kRows;
        }
        kernels.solve(num_panels, into, num_groups, diagonal, inverse);
      }
    }
  }
  if (done != nullptr) done[index].store(round, std::memory_order_release);
}

template <typename Real>
bool EliminateFront(const PanelFront<Real>& front, const FrontTiling& tiling, Real min_pivot) {
  std::atomic<bool> failed = false;
  for (int index = 0; index < tiling.num_tiles() && !failed; ++index) {
    EliminateTile<Real>(front, tiling, index, min_pivot, nullptr, 0, &failed);
  }
  return !failed;
}

template <typename Real>
void SolveForward(const PanelFront<Real>& front, Real* x, int num_threads) {
  constexpr int kRows = kPanelRows<Real>;
  const PanelKernels<Real>& kernels = CurrentPanelKernels<Real>();
  const int num_panels = front.num_panels();
  for (int begin = 0; begin < front.eliminated; begin += kSolveColumns) {
    const int end = std::min(begin + kSolveColumns, front.eliminated);
    for (int r = begin / kRows; r < end / kRows; ++r) {
      Real* y = x + r * kRows;
      const Real* panel = front.FactorPanel(r);
      kernels.subtract_product(panel + static_cast<size_t>(begin) * kRows, r * kRows - begin,
                               x + begin, y);
      const Real* diagonal = panel + static_cast<size_t>(r) * kRows * kRows;
      const Real* inverse = front.inverse_diagonal + r * kRows;
      for (int j = 0; j < kRows; ++j) {
        y[j] *= inverse[j];
        for (int i = j + 1; i < kRows; ++i) y[i] -= diagonal[j * kRows + i] * y[j];
      }
    }
    const int first = end / kRows;
    const size_t entries = static_cast<size_t>(num_panels - first) * kRows * (end - begin);
    ParallelFor(entries < kMinSharedEntries ? 1 : num_threads, num_panels - first,
                [&](size_t from, size_t to) {
                  for (size_t r = first + from; r < first + to; ++r) {
                    kernels.subtract_product(
                        front.FactorPanel(r) + static_cast<size_t>(begin) * kRows, end - begin,
                        x + begin, x + r * kRows);
                  }
                });
  }
}

template <typename Real>
void SolveBackward(const PanelFront<Real>& front, Real* x, Real* lanes, int num_threads) {
  constexpr int kRows = kPanelRows<Real>;
  constexpr int kMaxPanels = kSolveColumns / kRows;
  const PanelKernels<Real>& kernels = CurrentPanelKernels<Real>();
  std::fill_n(lanes, static_cast<size_t>(front.eliminated) * kRows, Real(0));
  // Adds what panels [first, end) contribute to the columns before `columns`.
  const auto add = [&](int first, int end, int columns) {
    const size_t entries = static_cast<size_t>(end - first) * kRows * columns;
    const int threads = entries < kMinSharedEntries ? 1 : num_threads;
    const int num_chunks = (columns + kSolveColumns - 1) / kSolveColumns;
    ParallelFor(threads, num_chunks, [&](size_t from, size_t to) {
      const size_t begin_column = from * kSolveColumns;
      const size_t end_column = std::min<size_t>(to * kSolveColumns, columns);
      for (int r = first; r < end; r += kMaxPanels) {
        const Real* panels[kMaxPanels];
        const int count = std::min(kMaxPanels, end - r);
        for (int p = 0; p < count; ++p) {
          panels[p] = front.FactorPanel(r + p) + begin_column * kRows;
        }
        kernels.add_transposed(count, panels, end_column - begin_column, x + r * kRows,
                               lanes + begin_column * kRows);
      }
    });
  };
  if (front.eliminated == 0) return;
  add(front.num_eliminated_panels(), front.num_panels(), front.eliminated);
  for (int begin = (front.eliminated - 1) / kSolveColumns * kSolveColumns; begin >= 0;
       begin -= kSolveColumns) {
    const int end = std::min(begin + kSolveColumns, front.eliminated);
    for (int r = end / kRows - 1; r >= begin / kRows; --r) {
      Real* y = x + r * kRows;
      const Real* panel = front.FactorPanel(r);
      const Real* diagonal = panel + static_cast<size_t>(r) * kRows * kRows;
      const Real* inverse = front.inverse_diagonal + r * kRows;
      for (int j = kRows - 1; j >= 0; --j) {
        const Real* lane = lanes + (static_cast<size_t>(r) * kRows + j) * kRows;
        Real sum = Real(0);
        for (int i = 0; i < kRows; ++i) sum += lane[i];
        for (int i = j + 1; i < kRows; ++i) sum += diagonal[j * kRows + i] * y[i];
        y[j] = (y[j] - sum) * inverse[j];
      }
      const Real* own = panel + static_cast<size_t>(begin) * kRows;
      kernels.add_transposed(1, &own, r * kRows - begin, y,
                             lanes + static_cast<size_t>(begin) * kRows);
    }
    if (begin > 0) add(begin / kRows, end / kRows, begin);
  }
}

template void EliminateTile<double>(const PanelFront<double>&, const FrontTiling&, int, double,
                                    std::atomic<uint32_t>*, uint32_t, std::atomic<bool>*);
template void EliminateTile<float>(const PanelFront<float>&, const FrontTiling&, int, float,
                                   std::atomic<uint32_t>*, uint32_t, std::atomic<bool>*);
template bool EliminateFront<double>(const PanelFront<double>&, const FrontTiling&, double);
template bool EliminateFront<float>(const PanelFront<float>&, const FrontTiling&, float);
template void SolveForward<double>(const PanelFront<double>&, double*, int);
template void SolveForward<float>(const PanelFront<float>&, float*, int);
template void SolveBackward<double>(const PanelFront<double>&, double*, double*, int);
template void SolveBackward<float>(const PanelFront<float>&, float*, float*, int);

}  // namespace holba
