// SPDX-License-Identifier: BSD-3-Clause
// Inner loops of dense Cholesky on matrices cut into row panels. A row panel is kPanelRows rows
// stored column after column (a column is 64 bytes): entry (i, j) at [j * kPanelRows + i]. This is
// at once the form in which a matrix product reads both of its factors, so nothing is ever packed.
// Columns are worked on in groups of 8. Each entry is summed up in one fixed order.
#pragma once

#include <cstddef>
#include <cstdint>

#include "holba/simd/targets.h"

namespace holba {

template <typename Real>
inline constexpr int kPanelRows = 64 / sizeof(Real);  // 8 doubles, 16 floats
inline constexpr int kGroupColumns = 8;

template <typename Real>
struct PanelKernels {
  // C -= A B^T for num_panels row panels times num_groups groups of columns. a[p]: panel p of A,
  // c[p]: panel p of C, both at their first column used; b[g]: the 8 rows of B that belong to group
  // g (in their panel, at the first column used); k: columns of A and B. `diagonal`: C is a
  // diagonal tile, panels that lie above group g are left out.
  void (*update)(int num_panels, const Real* const* a, Real* const* c, int num_groups,
                 const Real* const* b, int k, bool diagonal);

  // Cholesky factor, in place, of the diagonal tile whose panels are c[0], c[1], .., each at the
  // first column of the tile. inverse_diagonal: 8 * num_groups reciprocals of the factor's diagonal
  // are written. False: a pivot is not above min_pivot, or not finite.
  bool (*factorise)(int num_panels, Real* const* c, int num_groups, Real min_pivot,
                    Real* inverse_diagonal);

  // X L^T = C in place for num_panels panels c, L the factor of the diagonal tile in `diagonal`.
  void (*solve)(int num_panels, Real* const* c, int num_groups, const Real* const* diagonal,
                const Real* inverse_diagonal);

  // panel(i, j) = row_scale[i] * source(i, j) * column_scale[j] in the lanes first_lane ..
  // end_lane - 1, for num_columns columns. source points to what belongs to lane 0 and advances by
  // source_stride; up to 7 doubles (and scales) on either side of the lanes are read. Either both
  // scales are null, or none.
  void (*load)(const double* source, size_t source_stride, int num_columns, int first_lane,
               int end_lane, const double* row_scale, const double* column_scale, Real* panel);
  // The same with the source transposed: lane i of column j is source[i * source_stride + j].
  void (*load_transposed)(const double* source, size_t source_stride, int num_columns,
                          int first_lane, int end_lane, const double* row_scale,
                          const double* column_scale, Real* panel);

  // Adds num_columns columns of a panel to a target of row panels. Lane i of column j goes to
  // target[lane_offset[i] + kPanelRows * column[j]] for first_lane <= i < end_lane; lane_offset[i]
  // is the start of the target's panel (a multiple of kPanelRows) plus the lane there.
  void (*scatter_add)(const Real* panel, int num_columns, const int* column, int first_lane,
                      int end_lane, const size_t* lane_offset, Real* target);

  // y -= sum of panel column j times x[j]; y has kPanelRows entries.
  void (*subtract_product)(const Real* panel, int k, const Real* x, Real* y);
  // lanes[j * kPanelRows + i] += sum over panels p of panel_p(i, j) * x[p * kPanelRows + i].
  void (*add_transposed)(int num_panels, const Real* const* panels, int k, const Real* x,
                         Real* lanes);
};

HOLBA_SIMD_DECLARE(const PanelKernels<double>& DoublePanelKernels())
HOLBA_SIMD_DECLARE(const PanelKernels<float>& FloatPanelKernels())

// While one exists, numbers too small for the normal range count as zero on this thread. Float
// factors need it: fill decays below that range, where the processor is a hundred times slower.
class FlushTinyNumbers {
 public:
  FlushTinyNumbers();
  ~FlushTinyNumbers();
  FlushTinyNumbers(const FlushTinyNumbers&) = delete;
  FlushTinyNumbers& operator=(const FlushTinyNumbers&) = delete;

 private:
  uint64_t before_;
};

// Of the instruction set that the process uses (simd/targets.h).
template <typename Real>
const PanelKernels<Real>& CurrentPanelKernels();
template <>
inline const PanelKernels<double>& CurrentPanelKernels<double>() {
  return HOLBA_SIMD_CHOOSE(DoublePanelKernels)();
}
template <>
inline const PanelKernels<float>& CurrentPanelKernels<float>() {
  return HOLBA_SIMD_CHOOSE(FloatPanelKernels)();
}

}  // namespace holba
