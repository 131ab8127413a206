// SPDX-License-Identifier: BSD-3-Clause
#include "holba/linear/front_inverse.h"

#include <algorithm>
#include <vector>

#include "holba/base/check.h"
#include "holba/base/threads.h"

namespace holba {
namespace {

constexpr int kRows = PanelMatrix::kRows;
constexpr int kTile = 192;
constexpr int kTilePanels = kTile / kRows;

int NumTiles(int n) { return (n + kTile - 1) / kTile; }

// Calls body(begin, end) for each tile of rows.
template <typename Body>
void ForTiles(int n, int num_threads, const Body& body) {
  ParallelTasks(static_cast<size_t>(n) < 2 * kTile ? 1 : num_threads, NumTiles(n), [&](size_t t) {
    body(static_cast<int>(t) * kTile, std::min(static_cast<int>(t + 1) * kTile, n));
  });
}

// C -= A B^T in rows [row_begin, row_end) and columns [column_begin, column_end), at most a tile
// each; k in [k_begin, k_end).
void SubtractProductTile(const PanelMatrix& a, const PanelMatrix& b, int row_begin, int row_end,
                         int column_begin, int column_end, int k_begin, int k_end, PanelMatrix* c) {
  const PanelKernels<double>& kernels = CurrentPanelKernels<double>();
  const int num_panels = (row_end - row_begin) / kRows;
  const int num_groups = (column_end - column_begin) / kGroupColumns;
  double* into[kTilePanels];
  for (int p = 0; p < num_panels; ++p) {
    into[p] = c->Panel(row_begin / kRows + p) + static_cast<size_t>(column_begin) * kRows;
  }
  for (int k = k_begin; k < k_end; k += kTile) {
    const double* left[kTilePanels];
    const double* right[kTilePanels];
    for (int p = 0; p < num_panels; ++p) {
      left[p] = a.Panel(row_begin / kRows + p) + static_cast<size_t>(k) * kRows;
    }
    for (int g = 0; g < num_groups; ++g) {
      right[g] = b.Panel(column_begin / kRows + g) + static_cast<size_t>(k) * kRows;
    }
    kernels.update(num_panels, left, into, num_groups, right, std::min(kTile, k_end - k), false);
  }
}

// C -= A B^T.
void SubtractProduct(const PanelMatrix& a, const PanelMatrix& b, int num_threads, PanelMatrix* c) {
  HOLBA_CHECK(a.columns == b.columns && c->rows == a.rows && c->columns == b.rows);
  ForTiles(a.rows, num_threads, [&](int begin, int end) {
    for (int column = 0; column < b.rows; column += kTile) {
      SubtractProductTile(a, b, begin, end, column, std::min(column + kTile, b.rows), 0, a.columns,
                          c);
    }
  });
}

PanelMatrix Transposed(const PanelMatrix& a, double sign, int num_threads) {
  PanelMatrix t((a.columns + kRows - 1) / kRows * kRows, a.rows);
  ForTiles(a.rows, num_threads, [&](int begin, int end) {
    for (int r = begin / kRows; r < end / kRows; ++r) {
      const double* panel = a.Panel(r);
      for (int j = 0; j < a.columns; ++j) {
        double* to = t.Panel(j / kRows) + static_cast<size_t>(r) * kRows * kRows + j % kRows;
        for (int i = 0; i < kRows; ++i) to[i * kRows] = sign * panel[j * kRows + i];
      }
    }
  });
  return t;
}

// K^T = I L11^-T, an upper triangle.
PanelMatrix TransposedInverse(const PanelFront<double>& front, int num_threads) {
  const PanelKernels<double>& kernels = CurrentPanelKernels<double>();
  const int n = front.eliminated;
  PanelMatrix x(n, n);
  for (int i = 0; i < n; ++i) x(i, i) = 1.0;
  ForTiles(n, num_threads, [&](int begin, int end) {
    const int num_panels = (end - begin) / kRows;
    for (int column = begin; column < n; column += kTile) {
      const int column_end = std::min(column + kTile, n);
      double* into[kTilePanels];
      for (int p = 0; p < num_panels; ++p) {
        into[p] = x.Panel(begin / kRows + p) + static_cast<size_t>(column) * kRows;
      }
      const int num_groups = (column_end - column) / kGroupColumns;
      for (int k = begin; k < column; k += kTile) {
        const double* left[kTilePanels];
        const double* right[kTilePanels];
        for (int p = 0; p < num_panels; ++p) {
          left[p] = x.Panel(begin / kRows + p) + static_cast<size_t>(k) * kRows;
        }
        for (int g = 0; g < num_groups; ++g) {
          right[g] = front.FactorPanel(column / kRows + g) + static_cast<size_t>(k) * kRows;
        }
        kernels.update(num_panels, left, into, num_groups, right, std::min(kTile, column - k),
                       false);
      }
      const double* diagonal[kTilePanels];
      for (int p = 0; p < num_groups; ++p) {
        diagonal[p] = front.FactorPanel(column / kRows + p) + static_cast<size_t>(column) * kRows;
      }
      kernels.solve(num_panels, into, num_groups, diagonal, front.inverse_diagonal + column);
    }
  });
  return x;
}

}  // namespace

PanelMatrix FrontInverse(const PanelFront<double>& front, const PanelMatrix& z22, int num_threads) {
  static_assert(kRows == kGroupColumns, "a panel is one group of columns");
  const int w = front.eliminated;
  const int u = front.remaining;
  HOLBA_CHECK(z22.rows == u && z22.columns == u);
  const PanelMatrix k_transposed = TransposedInverse(front, num_threads);
  PanelMatrix v_transposed, z21;
  if (u > 0) {
    PanelMatrix l21(u, w);
    ForTiles(u, num_threads, [&](int begin, int end) {
      for (int r = begin / kRows; r < end / kRows; ++r) {
        std::copy_n(front.FactorPanel(w / kRows + r), static_cast<size_t>(kRows) * w, l21.Panel(r));
      }
    });
    PanelMatrix v(u, w);
    SubtractProduct(l21, k_transposed, num_threads, &v);
    v_transposed = Transposed(v, 1.0, num_threads);
    z21 = PanelMatrix(u, w);  // with the sign turned
    SubtractProduct(z22, v_transposed, num_threads, &z21);
  }
  PanelMatrix z11(w, w);  // with the sign turned; lower triangle
  const PanelMatrix z12 = Transposed(z21, -1.0, num_threads);
  ForTiles(w, num_threads, [&](int begin, int end) {
    for (int column = 0; column < end; column += kTile) {
      const int column_end = std::min(column + kTile, end);
      SubtractProductTile(k_transposed, k_transposed, begin, end, column, column_end, begin, w,
                          &z11);
      if (u > 0) {
        SubtractProductTile(v_transposed, z12, begin, end, column, column_end, 0, u, &z11);
      }
    }
  });

  PanelMatrix z(w + u, w + u);
  ForTiles(w + u, num_threads, [&](int begin, int end) {
    for (int i = begin; i < end; ++i) {
      for (int j = 0; j < w + u; ++j) {
        z(i, j) = i < w ? (j < w ? -(i >= j ? z11(i, j) : z11(j, i)) : z12(i, j - w))
                        : (j < w ? -z21(i - w, j) : z22(i - w, j - w));
      }
    }
  });
  return z;
}

void CopyBlock(const PanelMatrix& z, int row, int num_rows, int column, int num_columns,
               size_t stride, double* target) {
  for (int j = 0; j < num_columns; ++j) {
    for (int i = 0; i < num_rows; ++i) target[j * stride + i] = z(row + i, column + j);
  }
}

}  // namespace holba
