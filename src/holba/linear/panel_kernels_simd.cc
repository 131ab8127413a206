// SPDX-License-Identifier: BSD-3-Clause
// Inner loops of dense Cholesky (panel_kernels.h), compiled once for each instruction set. The
// product kernel keeps a small block of C in registers: 3 panels by 8 columns where a panel row is
// one register, fewer columns where it is several.
#include <type_traits>

#include "holba/linear/panel_kernels.h"
#include "holba/simd/pack.h"

namespace holba::HOLBA_SIMD_TARGET {
namespace {

#ifndef HOLBA_SIMD_BYTES
#define HOLBA_SIMD_BYTES 0  // scalar
#endif
#define HOLBA_UNROLL _Pragma("GCC unroll 16")

#if defined(HOLBA_SIMD_SCALAR)
template <typename Real>
struct VectorOf {
  using Type = Real;
  using Unaligned = Real;
};
#else
template <typename Real>
struct VectorOf {
  using Type __attribute__((vector_size(HOLBA_SIMD_BYTES))) = Real;
  using Unaligned __attribute__((vector_size(HOLBA_SIMD_BYTES), aligned(sizeof(Real)), may_alias)) =
      Real;
};
#endif
inline constexpr int kVectorBytes = HOLBA_SIMD_BYTES;

template <typename Real>
using Vector = typename VectorOf<Real>::Type;

template <typename Real>
inline constexpr int kVectorLanes = kVectorBytes == 0 ? 1 : kVectorBytes / sizeof(Real);
// Registers of one column of a panel.
template <typename Real>
inline constexpr int kRegisters = kPanelRows<Real> / kVectorLanes<Real>;
// One register a panel column, and enough of them for 3 panels by 8 columns.
inline constexpr bool kWide = kVectorBytes == 64;

template <typename Real>
HOLBA_SIMD_INLINE Vector<Real> LoadVector(const Real* p) {
  return *reinterpret_cast<const typename VectorOf<Real>::Unaligned*>(p);
}
template <typename Real>
HOLBA_SIMD_INLINE void StoreVector(Vector<Real> x, Real* p) {
  *reinterpret_cast<typename VectorOf<Real>::Unaligned*>(p) = x;
}
template <typename Real>
HOLBA_SIMD_INLINE Vector<Real> Splat(Real x) {
  return x - Vector<Real>{};
}

// C -= A B^T for kPanels panels by kColumns columns; b: row of the first column.
template <typename Real, int kPanels, int kColumns>
HOLBA_SIMD_INLINE void UpdateBlock(const Real* const* a, Real* const* c, size_t c_offset,
                                   const Real* b, int k) {
  constexpr int kRows = kPanelRows<Real>;
  constexpr int kRegs = kRegisters<Real>;
  Vector<Real> sum[kColumns][kPanels * kRegs];
  const Real* a_now[kPanels];
  HOLBA_UNROLL
  for (int p = 0; p < kPanels; ++p) {
    a_now[p] = a[p];
    HOLBA_UNROLL
    for (int j = 0; j < kColumns; ++j) {
      HOLBA_UNROLL
      for (int r = 0; r < kRegs; ++r) {
        sum[j][p * kRegs + r] =
            LoadVector<Real>(c[p] + c_offset + j * kRows + r * kVectorLanes<Real>);
      }
    }
  }
  for (int l = 0; l < k; ++l) {
    Vector<Real> a_column[kPanels * kRegs];
    HOLBA_UNROLL
    for (int p = 0; p < kPanels; ++p) {
      HOLBA_UNROLL
      for (int r = 0; r < kRegs; ++r) {
        a_column[p * kRegs + r] = LoadVector<Real>(a_now[p] + l * kRows + r * kVectorLanes<Real>);
      }
    }
    HOLBA_UNROLL
    for (int j = 0; j < kColumns; ++j) {
      const Vector<Real> b_entry = Splat<Real>(b[l * kRows + j]);
      HOLBA_UNROLL
      for (int r = 0; r < kPanels * kRegs; ++r) sum[j][r] -= a_column[r] * b_entry;
    }
  }
  HOLBA_UNROLL
  for (int p = 0; p < kPanels; ++p) {
    HOLBA_UNROLL
    for (int j = 0; j < kColumns; ++j) {
      HOLBA_UNROLL
      for (int r = 0; r < kRegs; ++r) {
        StoreVector<Real>(sum[j][p * kRegs + r],
                          c[p] + c_offset + j * kRows + r * kVectorLanes<Real>);
      }
    }
  }
}

// One group of columns of kPanels panels.
template <typename Real, int kPanels>
HOLBA_SIMD_INLINE void UpdateGroup(const Real* const* a, Real* const* c, size_t c_offset,
                                   const Real* b, int k) {
  if constexpr (kWide) {
    UpdateBlock<Real, kPanels, kGroupColumns>(a, c, c_offset, b, k);
  } else {
    constexpr int kColumns = kVectorBytes == 32 ? 4 : kVectorBytes == 16 ? 2 : 1;
    for (int p = 0; p < kPanels; ++p) {
      for (int j = 0; j < kGroupColumns; j += kColumns) {
        UpdateBlock<Real, 1, kColumns>(a + p, c + p, c_offset + j * kPanelRows<Real>, b + j, k);
      }
    }
  }
}

template <typename Real>
void UpdateGroupOfAny(int num_panels, const Real* const* a, Real* const* c, size_t c_offset,
                      const Real* b, int k) {
  if (num_panels == 3) {
    UpdateGroup<Real, 3>(a, c, c_offset, b, k);
  } else if (num_panels == 2) {
    UpdateGroup<Real, 2>(a, c, c_offset, b, k);
  } else {
    UpdateGroup<Real, 1>(a, c, c_offset, b, k);
  }
}

template <typename Real>
void Update(int num_panels, const Real* const* a, Real* const* c, int num_groups,
            const Real* const* b, int k, bool diagonal) {
  constexpr int kRows = kPanelRows<Real>;
  // Panels outside, groups inside: three panels of A stay in the first cache.
  for (int p = 0; p < num_panels; p += 3) {
    const int count = num_panels - p < 3 ? num_panels - p : 3;
    int end_group = num_groups;
    if (diagonal) {
      const int groups_above_end = (p + count) * (kRows / kGroupColumns);
      if (groups_above_end < end_group) end_group = groups_above_end;
    }
    for (int g = 0; g < end_group; ++g) {
      int first = 0;
      if (diagonal) {
        first = g * kGroupColumns / kRows - p;
        if (first < 0) first = 0;
      }
      UpdateGroupOfAny<Real>(count - first, a + p + first, c + p + first,
                             static_cast<size_t>(g) * kGroupColumns * kRows, b[g], k);
    }
  }
}

// X L^T = C for one group of columns of kPanels panels. l: the 8 x 8 factor (columns kPanelRows
// apart), inverse: reciprocals of its diagonal.
template <typename Real, int kVectors>
HOLBA_SIMD_INLINE void SolveVectors(Real* const* c, const Real* l, const Real* inverse) {
  constexpr int kRows = kPanelRows<Real>;
  Vector<Real> x[kGroupColumns][kVectors];
  HOLBA_UNROLL
  for (int j = 0; j < kGroupColumns; ++j) {
    HOLBA_UNROLL
    for (int v = 0; v < kVectors; ++v) x[j][v] = LoadVector<Real>(c[v] + j * kRows);
  }
  HOLBA_UNROLL
  for (int j = 0; j < kGroupColumns; ++j) {
    const Vector<Real> scale = Splat<Real>(inverse[j]);
    HOLBA_UNROLL
    for (int v = 0; v < kVectors; ++v) {
      x[j][v] *= scale;
      StoreVector<Real>(x[j][v], c[v] + j * kRows);
    }
    HOLBA_UNROLL
    for (int i = 1; i < kGroupColumns; ++i) {
      if (i <= j) continue;
      const Vector<Real> factor = Splat<Real>(l[j * kRows + i]);
      HOLBA_UNROLL
      for (int v = 0; v < kVectors; ++v) x[i][v] -= x[j][v] * factor;
    }
  }
}

template <typename Real>
void SolveGroup(int num_panels, Real* const* c, size_t c_offset, const Real* l,
                const Real* inverse) {
  if constexpr (kWide) {
    Real* at[3];
    for (int p = 0; p < num_panels; ++p) at[p] = c[p] + c_offset;
    if (num_panels == 3) {
      SolveVectors<Real, 3>(at, l, inverse);
    } else if (num_panels == 2) {
      SolveVectors<Real, 2>(at, l, inverse);
    } else {
      SolveVectors<Real, 1>(at, l, inverse);
    }
  } else {
    for (int p = 0; p < num_panels; ++p) {
      for (int r = 0; r < kRegisters<Real>; ++r) {
        Real* at = c[p] + c_offset + r * kVectorLanes<Real>;
        SolveVectors<Real, 1>(&at, l, inverse);
      }
    }
  }
}

// Cholesky factor of the 8 x 8 block at c (columns kPanelRows apart), lower triangle.
template <typename Real>
bool FactoriseBlock(Real* c, Real min_pivot, Real* inverse) {
  constexpr int kRows = kPanelRows<Real>;
  constexpr int n = kGroupColumns;
  Real l[n][n];  // l[column][row]
  for (int j = 0; j < n; ++j) {
    for (int i = 0; i < n; ++i) l[j][i] = c[j * kRows + i];
  }
  HOLBA_UNROLL
  for (int j = 0; j < n; ++j) {
    const Real pivot = l[j][j];
    // The comparison with infinity also refuses what overflowed; both refuse NaN.
    if (!(pivot > min_pivot && pivot < static_cast<Real>(__builtin_inf()))) return false;
    const Real root = sizeof(Real) == 8 ? static_cast<Real>(__builtin_sqrt(pivot))
                                        : static_cast<Real>(__builtin_sqrtf(pivot));
    const Real reciprocal = Real(1) / root;
    inverse[j] = reciprocal;
    l[j][j] = root;
    HOLBA_UNROLL
    for (int i = 0; i < n; ++i) {
      if (i > j) l[j][i] *= reciprocal;
    }
    HOLBA_UNROLL
    for (int m = 0; m < n; ++m) {
      if (m <= j) continue;
      HOLBA_UNROLL
      for (int i = 0; i < n; ++i) {
        if (i >= m) l[m][i] -= l[j][i] * l[j][m];
      }
    }
  }
  for (int j = 0; j < n; ++j) {
    for (int i = 0; i < n; ++i) c[j * kRows + i] = i >= j ? l[j][i] : Real(0);
  }
  return true;
}

template <typename Real>
bool Factorise(int num_panels, Real* const* c, int num_groups, Real min_pivot,
               Real* inverse_diagonal) {
  constexpr int kRows = kPanelRows<Real>;
  for (int g = 0; g < num_groups; ++g) {
    const int own_panel = g * kGroupColumns / kRows;
    const int own_lane = g * kGroupColumns % kRows;
    const int k = g * kGroupColumns;
    const size_t c_offset = static_cast<size_t>(k) * kRows;
    for (int p = own_panel; p < num_panels; p += 3) {
      UpdateGroupOfAny<Real>(num_panels - p < 3 ? num_panels - p : 3, c + p, c + p, c_offset,
                             c[own_panel] + own_lane, k);
    }
    Real* block = c[own_panel] + c_offset + own_lane;
    Real* inverse = inverse_diagonal + k;
    if (!FactoriseBlock<Real>(block, min_pivot, inverse)) return false;
    if constexpr (kRows > kGroupColumns) {
      // The panel's other lanes: rows below the block are solved, rows above it are zero.
      for (int i = 0; i < own_lane; ++i) {
        for (int j = 0; j < kGroupColumns; ++j) block[j * kRows + i - own_lane] = Real(0);
      }
      for (int i = own_lane + kGroupColumns; i < kRows; ++i) {
        for (int j = 0; j < kGroupColumns; ++j) {
          Real* row = block - own_lane + i;
          Real x = row[j * kRows];
          for (int l = 0; l < j; ++l) x -= row[l * kRows] * block[l * kRows + j];
          row[j * kRows] = x * inverse[j];
        }
      }
    }
    for (int p = own_panel + 1; p < num_panels; p += 3) {
      SolveGroup<Real>(num_panels - p < 3 ? num_panels - p : 3, c + p, c_offset, block, inverse);
    }
  }
  return true;
}

template <typename Real>
void Solve(int num_panels, Real* const* c, int num_groups, const Real* const* diagonal,
           const Real* inverse_diagonal) {
  constexpr int kRows = kPanelRows<Real>;
  for (int p = 0; p < num_panels; p += 3) {
    const int count = num_panels - p < 3 ? num_panels - p : 3;
    for (int g = 0; g < num_groups; ++g) {
      const int k = g * kGroupColumns;
      const size_t c_offset = static_cast<size_t>(k) * kRows;
      const Real* own = diagonal[k / kRows] + k % kRows;
      UpdateGroupOfAny<Real>(count, c + p, c + p, c_offset, own, k);
      SolveGroup<Real>(count, c + p, c_offset, own + c_offset, inverse_diagonal + k);
    }
  }
}

#if !defined(HOLBA_SIMD_SCALAR)
// Lanes by eights, which narrower instruction sets take as several registers.
using EightDoubles __attribute__((vector_size(64))) = double;
using EightFloats __attribute__((vector_size(32))) = float;
using EightOf64Bits __attribute__((vector_size(64))) = int64_t;
using EightOf32Bits __attribute__((vector_size(32))) = int32_t;
using UnalignedDoubles __attribute__((vector_size(64), aligned(8), may_alias)) = double;
template <typename Real>
using Eight = std::conditional_t<sizeof(Real) == 8, EightDoubles, EightFloats>;
template <typename Real>
using EightBits = std::conditional_t<sizeof(Real) == 8, EightOf64Bits, EightOf32Bits>;

// Whole registers, blended: a lane at a time would cost several times more.
template <typename Real, bool kScaled>
void LoadEight(const double* source, size_t source_stride, int num_columns, int first_lane,
               int end_lane, const double* row_scale, const double* column_scale, Real* panel) {
  constexpr int kRows = kPanelRows<Real>;
  EightBits<Real> in_range;
  for (int i = 0; i < 8; ++i) in_range[i] = i >= first_lane && i < end_lane ? -1 : 0;
  EightDoubles scales{};
  if constexpr (kScaled) scales = *reinterpret_cast<const UnalignedDoubles*>(row_scale);
  for (int j = 0; j < num_columns; ++j) {
    EightDoubles now = *reinterpret_cast<const UnalignedDoubles*>(source + j * source_stride);
    if constexpr (kScaled) now = now * scales * (column_scale[j] - EightDoubles{});
    Eight<Real>* at = reinterpret_cast<Eight<Real>*>(panel + j * kRows);
    *at = in_range ? __builtin_convertvector(now, Eight<Real>) : *at;
  }
}
#endif

template <typename Real>
void Load(const double* source, size_t source_stride, int num_columns, int first_lane, int end_lane,
          const double* row_scale, const double* column_scale, Real* panel) {
#if defined(HOLBA_SIMD_SCALAR)
  constexpr int kRows = kPanelRows<Real>;
  for (int j = 0; j < num_columns; ++j) {
    const double* from = source + j * source_stride;
    Real* to = panel + j * kRows;
    if (row_scale == nullptr) {
      for (int i = first_lane; i < end_lane; ++i) to[i] = static_cast<Real>(from[i]);
    } else {
      for (int i = first_lane; i < end_lane; ++i) {
        to[i] = static_cast<Real>(from[i] * row_scale[i] * column_scale[j]);
      }
    }
  }
#else
  for (int lane = 0; lane < kPanelRows<Real>; lane += 8) {
    if (end_lane <= lane || first_lane >= lane + 8) continue;
    if (row_scale == nullptr) {
      LoadEight<Real, false>(source + lane, source_stride, num_columns, first_lane - lane,
                             end_lane - lane, nullptr, nullptr, panel + lane);
    } else {
      LoadEight<Real, true>(source + lane, source_stride, num_columns, first_lane - lane,
                            end_lane - lane, row_scale + lane, column_scale, panel + lane);
    }
  }
#endif
}

#if HOLBA_SIMD_BYTES == 64
// x[i][j] becomes x[j][i].
HOLBA_SIMD_INLINE void TransposeEight(EightDoubles* x) {
  using Index = EightOf64Bits;
  EightDoubles y[8], z[8];
  HOLBA_UNROLL
  for (int i = 0; i < 8; i += 2) {  // 2 x 2 blocks
    y[i] = __builtin_shuffle(x[i], x[i + 1], Index{0, 8, 2, 10, 4, 12, 6, 14});
    y[i + 1] = __builtin_shuffle(x[i], x[i + 1], Index{1, 9, 3, 11, 5, 13, 7, 15});
  }
  HOLBA_UNROLL
  for (int i = 0; i < 8; ++i) {  // 4 x 4 blocks
    if (i & 2) continue;
    z[i] = __builtin_shuffle(y[i], y[i + 2], Index{0, 1, 8, 9, 4, 5, 12, 13});
    z[i + 2] = __builtin_shuffle(y[i], y[i + 2], Index{2, 3, 10, 11, 6, 7, 14, 15});
  }
  HOLBA_UNROLL
  for (int i = 0; i < 4; ++i) {
    x[i] = __builtin_shuffle(z[i], z[i + 4], Index{0, 1, 2, 3, 8, 9, 10, 11});
    x[i + 4] = __builtin_shuffle(z[i], z[i + 4], Index{4, 5, 6, 7, 12, 13, 14, 15});
  }
}

// Columns by eights and lanes by eights; what lies past them is read only inside a stored block.
template <typename Real, bool kScaled>
void LoadTransposedEight(const double* source, size_t source_stride, int num_columns,
                         int first_lane, int end_lane, const double* row_scale,
                         const double* column_scale, Real* panel) {
  constexpr int kRows = kPanelRows<Real>;
  EightBits<Real> in_range;
  for (int i = 0; i < 8; ++i) in_range[i] = i >= first_lane && i < end_lane ? -1 : 0;
  EightDoubles scales{};
  if constexpr (kScaled) scales = *reinterpret_cast<const UnalignedDoubles*>(row_scale);
  for (int begin = 0; begin < num_columns; begin += 8) {
    EightDoubles x[8];
    HOLBA_UNROLL
    for (int i = 0; i < 8; ++i) {
      x[i] = EightDoubles{};
      if (i >= first_lane && i < end_lane) {
        x[i] = *reinterpret_cast<const UnalignedDoubles*>(
            source + static_cast<ptrdiff_t>(i) * static_cast<ptrdiff_t>(source_stride) + begin);
      }
    }
    TransposeEight(x);
    HOLBA_UNROLL
    for (int j = 0; j < 8; ++j) {
      if (begin + j >= num_columns) continue;
      if constexpr (kScaled) x[j] = x[j] * scales * (column_scale[begin + j] - EightDoubles{});
      Eight<Real>* at = reinterpret_cast<Eight<Real>*>(panel + (begin + j) * kRows);
      *at = in_range ? __builtin_convertvector(x[j], Eight<Real>) : *at;
    }
  }
}
#endif

template <typename Real>
void LoadTransposed(const double* source, size_t source_stride, int num_columns, int first_lane,
                    int end_lane, const double* row_scale, const double* column_scale,
                    Real* panel) {
  constexpr int kRows = kPanelRows<Real>;
#if HOLBA_SIMD_BYTES == 64
  for (int lane = 0; lane < kRows; lane += 8) {
    if (end_lane <= lane || first_lane >= lane + 8) continue;
    if (row_scale == nullptr) {
      LoadTransposedEight<Real, false>(source + lane * static_cast<ptrdiff_t>(source_stride),
                                       source_stride, num_columns, first_lane - lane,
                                       end_lane - lane, nullptr, nullptr, panel + lane);
    } else {
      LoadTransposedEight<Real, true>(
          source + lane * static_cast<ptrdiff_t>(source_stride), source_stride, num_columns,
          first_lane - lane, end_lane - lane, row_scale + lane, column_scale, panel + lane);
    }
  }
#else
  for (int i = first_lane; i < end_lane; ++i) {
    const double* from = source + i * source_stride;
    if (row_scale == nullptr) {
      for (int j = 0; j < num_columns; ++j) panel[j * kRows + i] = static_cast<Real>(from[j]);
    } else {
      for (int j = 0; j < num_columns; ++j) {
        panel[j * kRows + i] = static_cast<Real>(from[j] * row_scale[i] * column_scale[j]);
      }
    }
  }
#endif
}

template <typename Real>
void ScatterAdd(const Real* panel, int num_columns, const int* column, int first_lane, int end_lane,
                const size_t* lane_offset, Real* target) {
  constexpr int kRows = kPanelRows<Real>;
  int begin = first_lane;
  while (begin < end_lane) {
    // Lanes that stay neighbours in the target.
    int end = begin + 1;
    while (end < end_lane && lane_offset[end] == lane_offset[end - 1] + 1 &&
           lane_offset[end] % kRows != 0) {
      ++end;
    }
    const int lane = static_cast<int>(lane_offset[begin] % kRows);
    Real* to = target + (lane_offset[begin] - lane);
#if !defined(HOLBA_SIMD_SCALAR)
    if constexpr (kWide) {
      using Integer = std::conditional_t<sizeof(Real) == 8, int64_t, int32_t>;
      using Index __attribute__((vector_size(HOLBA_SIMD_BYTES))) = Integer;
      Index from, in_range;
      for (int i = 0; i < kRows; ++i) {
        from[i] = (i - lane + begin) & (kRows - 1);
        in_range[i] = i >= lane && i < lane + end - begin ? -1 : 0;
      }
      for (int j = 0; j < num_columns; ++j) {
        const Vector<Real> all = LoadVector<Real>(panel + j * kRows);
        const Vector<Real> moved = __builtin_shuffle(all, from);
        Real* at = to + static_cast<size_t>(column[j]) * kRows;
        const Vector<Real> old = LoadVector<Real>(at);
        StoreVector<Real>(old + (in_range ? moved : Vector<Real>{}), at);
      }
      begin = end;
      continue;
    }
#endif
    for (int j = 0; j < num_columns; ++j) {
      const Real* from = panel + j * kRows + begin;
      Real* at = to + static_cast<size_t>(column[j]) * kRows + lane;
      for (int i = 0; i < end - begin; ++i) at[i] += from[i];
    }
    begin = end;
  }
}

template <typename Real>
void SubtractProduct(const Real* panel, int k, const Real* x, Real* y) {
  constexpr int kRows = kPanelRows<Real>;
  constexpr int kRegs = kRegisters<Real>;
  // Four sums, so that additions overlap.
  constexpr int kSums = kRegs >= 4 ? 1 : 4;
  Vector<Real> sum[kSums][kRegs] = {};
  int j = 0;
  for (; j + kSums <= k; j += kSums) {
    HOLBA_UNROLL
    for (int s = 0; s < kSums; ++s) {
      const Vector<Real> factor = Splat<Real>(x[j + s]);
      HOLBA_UNROLL
      for (int r = 0; r < kRegs; ++r) {
        sum[s][r] += LoadVector<Real>(panel + (j + s) * kRows + r * kVectorLanes<Real>) * factor;
      }
    }
  }
  for (; j < k; ++j) {
    for (int r = 0; r < kRegs; ++r) {
      sum[0][r] += LoadVector<Real>(panel + j * kRows + r * kVectorLanes<Real>) * Splat<Real>(x[j]);
    }
  }
  for (int r = 0; r < kRegs; ++r) {
    Vector<Real> total = sum[0][r];
    for (int s = 1; s < kSums; ++s) total += sum[s][r];
    Real* at = y + r * kVectorLanes<Real>;
    StoreVector<Real>(LoadVector<Real>(at) - total, at);
  }
}

template <typename Real, int kPanels>
HOLBA_SIMD_INLINE void AddTransposedBlock(const Real* const* panels, int k, const Real* x,
                                          Real* lanes) {
  constexpr int kRows = kPanelRows<Real>;
  for (int r = 0; r < kRegisters<Real>; ++r) {
    const int lane = r * kVectorLanes<Real>;
    Vector<Real> factor[kPanels];
    HOLBA_UNROLL
    for (int p = 0; p < kPanels; ++p) factor[p] = LoadVector<Real>(x + p * kRows + lane);
    for (int j = 0; j < k; ++j) {
      Vector<Real> sum = LoadVector<Real>(lanes + j * kRows + lane);
      HOLBA_UNROLL
      for (int p = 0; p < kPanels; ++p) {
        sum += LoadVector<Real>(panels[p] + j * kRows + lane) * factor[p];
      }
      StoreVector<Real>(sum, lanes + j * kRows + lane);
    }
  }
}

template <typename Real>
void AddTransposed(int num_panels, const Real* const* panels, int k, const Real* x, Real* lanes) {
  int p = 0;
  for (; p + 4 <= num_panels; p += 4) {
    AddTransposedBlock<Real, 4>(panels + p, k, x + p * kPanelRows<Real>, lanes);
  }
  for (; p < num_panels; ++p) {
    AddTransposedBlock<Real, 1>(panels + p, k, x + p * kPanelRows<Real>, lanes);
  }
}

template <typename Real>
constexpr PanelKernels<Real> Table() {
  return {Update<Real>,         Factorise<Real>,  Solve<Real>,           Load<Real>,
          LoadTransposed<Real>, ScatterAdd<Real>, SubtractProduct<Real>, AddTransposed<Real>};
}

constexpr PanelKernels<double> kDoubleKernels = Table<double>();
constexpr PanelKernels<float> kFloatKernels = Table<float>();

}  // namespace

const PanelKernels<double>& DoublePanelKernels() { return kDoubleKernels; }
const PanelKernels<float>& FloatPanelKernels() { return kFloatKernels; }

}  // namespace holba::HOLBA_SIMD_TARGET
