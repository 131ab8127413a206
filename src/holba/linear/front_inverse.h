// SPDX-License-Identifier: BSD-3-Clause
// The part of the inverse that belongs to one eliminated front (Takahashi, Fagan and Chin 1973, by
// fronts): with K = L11^-1, V = -L21 K and the inverse Z22 at the remaining rows,
//   Z21 = Z22 V,   Z11 = K^T K + V^T Z21.
#pragma once

#include "holba/linear/cholesky_factor.h"
#include "holba/linear/panel_front.h"

namespace holba {

// Rows x columns in row panels, whole: panel r at data + r * kRows * columns.
struct PanelMatrix {
  static constexpr int kRows = kPanelRows<double>;

  PanelMatrix() = default;
  PanelMatrix(int rows, int columns)
      : rows(rows), columns(columns), memory(static_cast<size_t>(rows) * columns) {}

  double* Panel(int r) { return memory.data() + static_cast<size_t>(r) * kRows * columns; }
  const double* Panel(int r) const {
    return memory.data() + static_cast<size_t>(r) * kRows * columns;
  }
  double& operator()(int i, int j) { return Panel(i / kRows)[j * kRows + i % kRows]; }
  double operator()(int i, int j) const { return Panel(i / kRows)[j * kRows + i % kRows]; }

  int rows = 0, columns = 0;  // rows: a multiple of kRows
  FactorMemory<double> memory;
};

// The inverse at all rows and columns of an eliminated front, both triangles. z22: the inverse at
// its remaining rows, of front.remaining rows and columns.
PanelMatrix FrontInverse(const PanelFront<double>& front, const PanelMatrix& z22, int num_threads);

// target(i, j) = Z(row[i], column[j]); target has a column every `stride` doubles.
void CopyBlock(const PanelMatrix& z, int row, int num_rows, int column, int num_columns,
               size_t stride, double* target);

}  // namespace holba
