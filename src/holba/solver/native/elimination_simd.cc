// SPDX-License-Identifier: BSD-3-Clause
#include "holba/simd/pack.h"
#include "holba/simd/rows.h"
#include "holba/solver/native/elimination.h"

namespace holba::native::HOLBA_SIMD_TARGET {

using namespace holba::HOLBA_SIMD_TARGET;  // NOLINT: the packs of this target

namespace {

constexpr int kMaxTangentOfFeature = 6;
constexpr int kMaxSegmentWidth = 24;
constexpr int kMaxRow = kFeatureRow + kMaxPanelSegments * kMaxSegmentWidth;
constexpr int kFeaturePacks = kFeatureRow / kLanes;

HOLBA_SIMD_INLINE int Min(int a, int b) { return a < b ? a : b; }

// ---- Single precision storage.

HOLBA_SIMD_INLINE Pack LoadFloats(const float* p) {
#if defined(HOLBA_SIMD_SCALAR)
  return *p;
#elif defined(__AVX512F__)
  return _mm512_cvtps_pd(_mm256_loadu_ps(p));
#elif defined(__AVX2__)
  return _mm256_cvtps_pd(_mm_loadu_ps(p));
#else
  Pack x{};
  for (int i = 0; i < kLanes; ++i) x[i] = p[i];
  return x;
#endif
}
HOLBA_SIMD_INLINE void StoreFloats(Pack x, float* p) {
#if defined(__AVX512F__)
  _mm256_storeu_ps(p, _mm512_cvtpd_ps(x));
#elif defined(__AVX2__)
  _mm_storeu_ps(p, _mm256_cvtpd_ps(x));
#else
  for (int i = 0; i < kLanes; ++i) p[i] = static_cast<float>(Lane(x, i));
#endif
}

// Calls body with the number of packs of a padded width (8, 16, 24) as a constant.
#define HOLBA_WITH_PACKS(padded, call)    \
  do {                                    \
    if ((padded) == 8) {                  \
      constexpr int kPacks = 8 / kLanes;  \
      call;                               \
    } else if ((padded) == 16) {          \
      constexpr int kPacks = 16 / kLanes; \
      call;                               \
    } else {                              \
      constexpr int kPacks = 24 / kLanes; \
      call;                               \
    }                                     \
  } while (false)

// The same with the tangent of the features: 3 (points), 4 (lines), others.
#define HOLBA_WITH_TANGENT(tangent, call) \
  do {                                    \
    switch (tangent) {                    \
      case 1: {                           \
        constexpr int kTangent = 1;       \
        call;                             \
        break;                            \
      }                                   \
      case 2: {                           \
        constexpr int kTangent = 2;       \
        call;                             \
        break;                            \
      }                                   \
      case 3: {                           \
        constexpr int kTangent = 3;       \
        call;                             \
        break;                            \
      }                                   \
      case 4: {                           \
        constexpr int kTangent = 4;       \
        call;                             \
        break;                            \
      }                                   \
      case 5: {                           \
        constexpr int kTangent = 5;       \
        call;                             \
        break;                            \
      }                                   \
      default: {                          \
        constexpr int kTangent = 6;       \
        call;                             \
        break;                            \
      }                                   \
    }                                     \
  } while (false)

// block += sum over the kDim rows of a b^T; a and b are padded rows.
template <int kDim>
HOLBA_SIMD_INLINE void AddOuterOf(double* block, const double* a, int width_a, const double* b,
                                  int width_b, int row_stride) {
  const int grouped = GroupedRows(width_a);
  for (int v = 0; v < grouped; v += kLanes) {
    Pack e[kDim];
    for (int k = 0; k < kDim; ++k) e[k] = Load(a + k * row_stride + v);
    double* column = block + v / 8 * 8 * width_b + v % 8;
    for (int c = 0; c < width_b; ++c, column += 8) {
      Pack sum = Load(column);
      for (int k = 0; k < kDim; ++k) sum += e[k] * b[k * row_stride + c];
      Store(sum, column);
    }
  }
  double* tail = block + grouped * width_b;
  const int padded = PaddedTo8(width_b);
  for (int row = grouped; row < width_a; ++row, tail += padded) {
    for (int c = 0; c < width_b; c += kLanes) {
      Pack sum = Load(tail + c);
      for (int k = 0; k < kDim; ++k) sum += Load(b + k * row_stride + c) * a[k * row_stride + row];
      Store(sum, tail + c);
    }
  }
}
HOLBA_SIMD_INLINE void AddOuter(double* block, const double* a, int width_a, const double* b,
                                int width_b, int dim, int row_stride) {
  if (dim == 2) return AddOuterOf<2>(block, a, width_a, b, width_b, row_stride);
  if (dim == 4) return AddOuterOf<4>(block, a, width_a, b, width_b, row_stride);
  for (int k = 0; k < dim; ++k)
    AddOuterOf<1>(block, a + k * row_stride, width_a, b + k * row_stride, width_b, row_stride);
}

// g += E^T r, diagonal of U, and the diagonal block of U, of one segment of one residual.
template <int kPacks>
HOLBA_SIMD_INLINE void AddOwn(const double* row, int dim, int row_stride, const double* e,
                              int width, double* block, double* gradient, double* diagonal) {
  Pack g[kPacks], d[kPacks];
  for (int v = 0; v < kPacks; ++v) {
    g[v] = Load(gradient + v * kLanes);
    d[v] = Load(diagonal + v * kLanes);
  }
  for (int k = 0; k < dim; ++k) {
    const double r = row[k * row_stride + kFeatureRow - 1];
    for (int v = 0; v < kPacks; ++v) {
      const Pack x = Load(e + k * row_stride + v * kLanes);
      g[v] += x * r;
      d[v] += x * x;
    }
  }
  for (int v = 0; v < kPacks; ++v) {
    Store(g[v], gradient + v * kLanes);
    Store(d[v], diagonal + v * kLanes);
  }
  AddOuter(block, e, width, e, width, dim, row_stride);
}

// W(:, i) += E^T F(:, i); the first touch sets it.
template <int kPacks, int kTangent>
HOLBA_SIMD_INLINE void AddW(const double* row, int dim, int row_stride, const double* e, bool first,
                            double* W) {
  Pack w[kTangent][kPacks];
  if (first) {
    for (int i = 0; i < kTangent; ++i) {
      for (int v = 0; v < kPacks; ++v) w[i][v] = Broadcast(0.0);
    }
  } else {
    for (int i = 0; i < kTangent; ++i) {
      for (int v = 0; v < kPacks; ++v) w[i][v] = Load(W + (i * kPacks + v) * kLanes);
    }
  }
  for (int k = 0; k < dim; ++k) {
    Pack x[kPacks];
    for (int v = 0; v < kPacks; ++v) x[v] = Load(e + k * row_stride + v * kLanes);
    for (int i = 0; i < kTangent; ++i) {
      for (int v = 0; v < kPacks; ++v) w[i][v] += x[v] * row[k * row_stride + i];
    }
  }
  for (int i = 0; i < kTangent; ++i) {
    for (int v = 0; v < kPacks; ++v) Store(w[i][v], W + (i * kPacks + v) * kLanes);
  }
}

// Of block (a, b), full pattern.
HOLBA_SIMD_INLINE size_t RowBlockOffset(const Sums& sums, uint32_t a, uint32_t b) {
  return sums.row_offset[a] + size_t{sums.unknown_offset[b]} * GroupedRows(sums.width[a]) +
         size_t{sums.padded_offset[b]} * TailRows(sums.width[a]);
}

// Block of nodes a >= b, at positions p and q of the clique; null: not kept.
HOLBA_SIMD_INLINE double* PairBlock(const Sums& sums, const ChunkFeatures& chunk, uint32_t clique,
                                    double* blocks, uint32_t p, uint32_t q, uint32_t a,
                                    uint32_t b) {
  if (chunk.pairs_begin == nullptr) {
    return blocks + RowBlockOffset(sums, a, b);
  }
  const uint32_t offset =
      chunk.pairs[chunk.pairs_begin[clique - chunk.first_clique] + size_t{p} * (p + 1) / 2 + q];
  return offset == kNoBlock ? nullptr : blocks + size_t{offset} * kFeatureRow;
}

// Accumulate for residuals of one segment, whose size and dimension are constants: points and lines
// seen by cameras, most of all residuals.
template <int kTangent, int kDim, int kWidth>
void AccumulateAlone(const Panel& panel, const double* rows, const ChunkFeatures& chunk,
                     const Sums& sums) {
  constexpr int kPadded = PaddedTo8(kWidth), kPacks = kPadded / kLanes;
  constexpr int kGrouped = GroupedRows(kWidth), kRowStride = kFeatureRow + kPadded;
  const double* row = rows;
  for (size_t j = 0; j < panel.count;) {
    const uint32_t f = panel.local_feature[j];
    const uint32_t* nodes = chunk.clique_nodes + chunk.clique_begin[chunk.clique[f]];
    const uint32_t* w_offset = chunk.w_offset + chunk.first_position[f];
    double* V = chunk.V + size_t{f} * kTangent * kFeatureRow;
    Pack sum[kTangent][kFeaturePacks];
    for (int i = 0; i < kTangent; ++i) {
      for (int v = 0; v < kFeaturePacks; ++v) sum[i][v] = Load(V + i * kFeatureRow + v * kLanes);
    }
    for (; j < panel.count && panel.local_feature[j] == f; ++j, row += kDim * kRowStride) {
      for (int k = 0; k < kDim; ++k) {
        const double* feature_row = row + k * kRowStride;
        for (int v = 0; v < kFeaturePacks; ++v) {
          const Pack x = Load(feature_row + v * kLanes);
          for (int i = 0; i < kTangent; ++i) sum[i][v] += x * feature_row[i];
        }
      }
      if (panel.positions[j] == kNoPosition) continue;
      const uint32_t position = panel.positions[j] & kPositionMask;
      const bool first = (panel.positions[j] & kFirstTouch) != 0;
      const uint32_t node = nodes[position];
      const double* e = row + kFeatureRow;
      AddW<kPacks, kTangent>(row, kDim, kRowStride, e, first, chunk.W + w_offset[position]);
      double* block = sums.U + size_t{sums.diagonal_offset[node]} * kFeatureRow;
      double* gradient = sums.gradient + sums.padded_offset[node];
      double* diagonal = sums.diagonal + sums.padded_offset[node];
      for (int v = 0; v < kPadded; v += kLanes) {
        Pack x[kDim];
        Pack g = Load(gradient + v), d = Load(diagonal + v);
        for (int k = 0; k < kDim; ++k) {
          x[k] = Load(e + k * kRowStride + v);
          g += x[k] * row[k * kRowStride + kFeatureRow - 1];
          d += x[k] * x[k];
        }
        Store(g, gradient + v);
        Store(d, diagonal + v);
        if (v < kGrouped) {
          double* column = block + v / 8 * 8 * kWidth + v % 8;
          for (int c = 0; c < kWidth; ++c) {
            Pack u = Load(column + c * 8);
            for (int k = 0; k < kDim; ++k) u += x[k] * e[k * kRowStride + c];
            Store(u, column + c * 8);
          }
        }
        for (int r = kGrouped; r < kWidth; ++r) {
          double* tail = block + kGrouped * kWidth + (r - kGrouped) * kPadded + v;
          Pack u = Load(tail);
          for (int k = 0; k < kDim; ++k) u += x[k] * e[k * kRowStride + r];
          Store(u, tail);
        }
      }
    }
    for (int i = 0; i < kTangent; ++i) {
      for (int v = 0; v < kFeaturePacks; ++v) Store(sum[i][v], V + i * kFeatureRow + v * kLanes);
    }
  }
}

template <int kTangent>
void AccumulateOf(const Panel& panel, const double* rows, const ChunkFeatures& chunk,
                  const Sums& sums) {
  if (panel.num_segments == 1) {
    const int width = panel.segments[0].width;
    if constexpr (kTangent == 3) {
      if (panel.dim == 2 && width == 6)
        return AccumulateAlone<kTangent, 2, 6>(panel, rows, chunk, sums);
      if (panel.dim == 2 && width == 9)
        return AccumulateAlone<kTangent, 2, 9>(panel, rows, chunk, sums);
    }
    if constexpr (kTangent == 3 || kTangent == 4) {
      if (panel.dim == 1 && width == 6)
        return AccumulateAlone<kTangent, 1, 6>(panel, rows, chunk, sums);
    }
    if constexpr (kTangent == 4) {
      if (panel.dim == 4 && width == 6)
        return AccumulateAlone<kTangent, 4, 6>(panel, rows, chunk, sums);
    }
  }
  const int dim = panel.dim, row_stride = panel.row_stride;
  for (size_t j = 0; j < panel.count;) {
    const uint32_t f = panel.local_feature[j];
    const uint32_t clique = chunk.clique[f];
    const uint32_t* nodes = chunk.clique_nodes + chunk.clique_begin[clique];
    double* V = chunk.V + size_t{f} * kTangent * kFeatureRow;
    Pack sum[kTangent][kFeaturePacks];
    for (int i = 0; i < kTangent; ++i) {
      for (int v = 0; v < kFeaturePacks; ++v) sum[i][v] = Load(V + i * kFeatureRow + v * kLanes);
    }
    for (; j < panel.count && panel.local_feature[j] == f; ++j) {
      const double* row = rows + j * dim * row_stride;
      for (int k = 0; k < dim; ++k) {
        const double* feature_row = row + k * row_stride;
        Pack x[kFeaturePacks];
        for (int v = 0; v < kFeaturePacks; ++v) x[v] = Load(feature_row + v * kLanes);
        for (int i = 0; i < kTangent; ++i) {
          for (int v = 0; v < kFeaturePacks; ++v) sum[i][v] += x[v] * feature_row[i];
        }
      }
      const uint16_t* positions = panel.positions + j * panel.num_segments;
      const double* e = row + kFeatureRow;
      for (int s = 0; s < panel.num_segments; e += panel.segments[s].padded, ++s) {
        if (positions[s] == kNoPosition) continue;
        const PanelSegment& segment = panel.segments[s];
        const uint32_t position = positions[s] & kPositionMask;
        const bool first = (positions[s] & kFirstTouch) != 0;
        const uint32_t node = nodes[position];
        double* W = chunk.W + chunk.w_offset[chunk.first_position[f] + position];
        double* block = sums.U + size_t{sums.diagonal_offset[node]} * kFeatureRow;
        double* gradient = sums.gradient + sums.padded_offset[node];
        double* diagonal = sums.diagonal + sums.padded_offset[node];
        HOLBA_WITH_PACKS(segment.padded, (AddW<kPacks, kTangent>(row, dim, row_stride, e, first, W),
                                          AddOwn<kPacks>(row, dim, row_stride, e, segment.width,
                                                         block, gradient, diagonal)));
        const double* other = row + kFeatureRow;
        for (int t = 0; t < s; other += panel.segments[t].padded, ++t) {
          if (positions[t] == kNoPosition) continue;
          // Rows: the later node.
          const uint32_t other_position = positions[t] & kPositionMask;
          const bool swap = other_position > position;
          const int p = swap ? t : s, q = swap ? s : t;
          const uint32_t later = swap ? other_position : position,
                         earlier = swap ? position : other_position;
          double* pair = PairBlock(sums, chunk, clique, sums.U, later, earlier, nodes[later],
                                   nodes[earlier]);
          if (pair == nullptr) continue;
          const double* ep = swap ? other : e;
          const double* eq = swap ? e : other;
          AddOuter(pair, ep, panel.segments[p].width, eq, panel.segments[q].width, dim, row_stride);
        }
      }
    }
    for (int i = 0; i < kTangent; ++i) {
      for (int v = 0; v < kFeaturePacks; ++v) Store(sum[i][v], V + i * kFeatureRow + v * kLanes);
    }
  }
}

template <int kTangent>
ChunkSums FactoriseOf(const ChunkFeatures& chunk, double inverse_radius) {
  constexpr int kEntries = kTangent * (kTangent + 1) / 2;
  ChunkSums out;
  Pack largest = Broadcast(0.0), not_finite = Broadcast(0.0);
  int64_t idx[kLanes];
  for (size_t i = 0; i < chunk.stride; i += kLanes) {
    for (int l = 0; l < kLanes; ++l)
      idx[l] = static_cast<int64_t>((i + l) * kTangent * kFeatureRow);
    Pack L[kTangent][kTangent], inverse[kTangent][kTangent];
    for (int a = 0; a < kTangent; ++a) {
      Pack row[kFeatureRow];
      LoadRows<kFeatureRow>(chunk.V + a * kFeatureRow, idx, row);
      const Pack g = row[kFeatureRow - 1];
      Store(g, chunk.factors + (kEntries + a) * chunk.stride + i);
      const Pack size = Abs(g);
      largest = size > largest ? size : largest;
      not_finite += g - g;
      for (int b = 0; b <= a; ++b) L[a][b] = row[b];
    }
    for (int a = 0; a < kTangent; ++a) {
      const Pack v = L[a][a], root = 1.0 + Sqrt(v), floor = 1e-6 * root * root;
      const Pack damped = v + (v > floor ? v : floor) * inverse_radius;
      Pack pivot = damped;
      for (int k = 0; k < a; ++k) pivot -= L[a][k] * L[a][k];
      // A direction that nothing fixes does not move.
      const Pack inv = pivot > 1e-14 * damped ? 1.0 / Sqrt(pivot) : Broadcast(0.0);
      inverse[a][a] = inv;
      for (int b = a + 1; b < kTangent; ++b) {
        Pack x = L[b][a];
        for (int k = 0; k < a; ++k) x -= L[b][k] * L[a][k];
        L[b][a] = x * inv;
      }
    }
    for (int a = 0; a < kTangent; ++a) {
      for (int b = 0; b < a; ++b) {
        Pack x = L[a][b] * inverse[b][b];
        for (int k = b + 1; k < a; ++k) x += L[a][k] * inverse[k][b];
        inverse[a][b] = -x * inverse[a][a];
      }
      for (int b = 0; b <= a; ++b)
        Store(inverse[a][b], chunk.factors + (a * (a + 1) / 2 + b) * chunk.stride + i);
    }
  }
  for (int l = 0; l < kLanes; ++l)
    out.max_gradient = Lane(largest, l) > out.max_gradient ? Lane(largest, l) : out.max_gradient;
  out.max_gradient += Sum(not_finite);
  return out;
}

// W -> T = W L^-T in place; reduction += T y.
template <int kPacks, int kTangent>
HOLBA_SIMD_INLINE void FormTOf(double* W, const double* inverse, const double* y, double* reduction) {
  for (int v = 0; v < kPacks; ++v) {
    Pack w[kTangent];
    for (int i = 0; i < kTangent; ++i) w[i] = Load(W + (i * kPacks + v) * kLanes);
    Pack sum = Load(reduction + v * kLanes);
    for (int i = 0; i < kTangent; ++i) {
      Pack t = w[0] * inverse[i * (i + 1) / 2];
      for (int k = 1; k <= i; ++k) t += w[k] * inverse[i * (i + 1) / 2 + k];
      sum += t * y[i];
      Store(t, W + (i * kPacks + v) * kLanes);
    }
    Store(sum, reduction + v * kLanes);
  }
}

// Consecutive features with the same clique: T of the next one stands `stride` doubles on, in the
// same order. Their products are summed up in registers and S is touched once.
struct FeatureRun {
  size_t count;
  size_t stride;
};

// A group of 8 rows of a block, columns c < kColumns, -= sum over the run of T_p T_q^T.
template <int kTangent, int kColumns>
HOLBA_SIMD_INLINE void SubtractColumns(double* block, const double* Tp, int padded_p,
                                       const double* Tq, int padded_q, const FeatureRun& run) {
  for (int v = 0; v < 8; v += kLanes) {
    Pack sum[kColumns];
    for (int c = 0; c < kColumns; ++c) sum[c] = Load(block + c * 8 + v);
    const double *tp = Tp + v, *tq = Tq;
    for (size_t f = 0; f < run.count; ++f, tp += run.stride, tq += run.stride) {
      for (int i = 0; i < kTangent; ++i) {
        const Pack t = Load(tp + i * padded_p);
        for (int c = 0; c < kColumns; ++c) sum[c] -= t * tq[i * padded_q + c];
      }
    }
    for (int c = 0; c < kColumns; ++c) Store(sum[c], block + c * 8 + v);
  }
}

// S(p, q) -= T_p T_q^T, over the run.
template <int kTangent>
__attribute__((noinline)) void SubtractPair(double* block, int width_p, const double* Tp,
                                            int width_q, const double* Tq, const FeatureRun& run) {
  const int padded_p = PaddedTo8(width_p), padded_q = PaddedTo8(width_q);
  const int grouped = GroupedRows(width_p);
  for (int group = 0; group < grouped; group += 8) {
    int c = 0;
    const auto columns = [&]<int kColumns>() __attribute__((always_inline)) {
      SubtractColumns<kTangent, kColumns>(block, Tp + group, padded_p, Tq + c, padded_q, run);
      block += kColumns * 8;
      c += kColumns;
    };
    if (width_q == 6) {
      columns.template operator()<6>();
    } else if (width_q == 9) {
      columns.template operator()<9>();
    } else {
      while (width_q - c >= 4) columns.template operator()<4>();
      while (width_q - c >= 1) columns.template operator()<1>();
    }
  }
  for (int row = grouped; row < width_p; ++row, block += padded_q) {
    for (int c = 0; c < width_q; c += kLanes) {
      Pack sum = Load(block + c);
      const double *tp = Tp + row, *tq = Tq + c;
      for (size_t f = 0; f < run.count; ++f, tp += run.stride, tq += run.stride) {
        for (int i = 0; i < kTangent; ++i) sum -= Load(tq + i * padded_q) * tp[i * padded_p];
      }
      Store(sum, block + c);
    }
  }
}

// The same for two nodes of the width that most have, with every stride a constant.
template <int kTangent, int kWidth>
HOLBA_SIMD_INLINE void SubtractSquare(double* block, const double* Tp, const double* Tq,
                                      const FeatureRun& run) {
  constexpr int kPadded = PaddedTo8(kWidth), kGrouped = GroupedRows(kWidth);
  for (int v = 0; v < kGrouped; v += kLanes) {
    double* column = block + v / 8 * 8 * kWidth + v % 8;
    Pack sum[kWidth];
    for (int c = 0; c < kWidth; ++c) sum[c] = Load(column + c * 8);
    const double *tp = Tp + v, *tq = Tq;
    size_t f = run.count;
    do {
      for (int i = 0; i < kTangent; ++i) {
        const Pack t = Load(tp + i * kPadded);
        for (int c = 0; c < kWidth; ++c) sum[c] -= t * tq[i * kPadded + c];
      }
      tp += run.stride;
      tq += run.stride;
    } while (--f != 0);
    for (int c = 0; c < kWidth; ++c) Store(sum[c], column + c * 8);
  }
  for (int row = kGrouped; row < kWidth; ++row) {
    double* tail = block + kGrouped * kWidth + (row - kGrouped) * kPadded;
    for (int c = 0; c < kWidth; c += kLanes) {
      Pack sum = Load(tail + c);
      const double *tp = Tp + row, *tq = Tq + c;
      size_t f = run.count;
      do {
        for (int i = 0; i < kTangent; ++i) sum -= Load(tq + i * kPadded) * tp[i * kPadded];
        tp += run.stride;
        tq += run.stride;
      } while (--f != 0);
      Store(sum, tail + c);
    }
  }
}

// Row p of the clique's blocks: S(p, q) -= T_p T_q^T, q <= p.
template <int kTangent>
void SubtractRow(const ChunkFeatures& chunk, const Sums& sums, const uint32_t* nodes, uint32_t p,
                 const uint32_t* offsets, const uint32_t* w_offset, const FeatureRun& run) {
  const uint32_t a = nodes[p];
  const int width = sums.width[a];
  const double* Tp = chunk.W + w_offset[p];
  for (uint32_t q = 0; q <= p; ++q) {
    const uint32_t b = nodes[q];
    if (offsets != nullptr && offsets[q] == kNoBlock) continue;
    double* block = sums.S + (offsets == nullptr ? RowBlockOffset(sums, a, b)
                                                 : size_t{offsets[q]} * kFeatureRow);
    const double* Tq = chunk.W + w_offset[q];
    if (width == 6 && sums.width[b] == 6) {
      SubtractSquare<kTangent, 6>(block, Tp, Tq, run);
    } else if (width == 9 && sums.width[b] == 9) {
      SubtractSquare<kTangent, 9>(block, Tp, Tq, run);
    } else {
      SubtractPair<kTangent>(block, width, Tp, sums.width[b], Tq, run);
    }
  }
}

template <int kTangent, bool kSubtract>
void EliminateOf(const ChunkFeatures& chunk, const Sums& sums) {
  constexpr int kEntries = kTangent * (kTangent + 1) / 2;
  for (size_t begin = 0; begin < chunk.count;) {
    const uint32_t clique = chunk.clique[begin];
    const uint32_t* nodes = chunk.clique_nodes + chunk.clique_begin[clique];
    const uint32_t size = chunk.clique_begin[clique + 1] - chunk.clique_begin[clique];
    const uint32_t* first_offset = chunk.w_offset + chunk.first_position[begin];
    size_t f = begin;
    for (; f < chunk.count && chunk.clique[f] == clique; ++f) {
      double inverse[kEntries], y[kTangent];
      for (int k = 0; k < kEntries; ++k) inverse[k] = chunk.factors[k * chunk.stride + f];
      for (int a = 0; a < kTangent; ++a) {
        y[a] = 0.0;
        for (int b = 0; b <= a; ++b)
          y[a] += inverse[a * (a + 1) / 2 + b] * chunk.factors[(kEntries + b) * chunk.stride + f];
      }
      const uint32_t* w_offset = chunk.w_offset + chunk.first_position[f];
      for (uint32_t p = 0; p < size; ++p) {
        const uint32_t at = sums.padded_offset[nodes[p]];
        const int padded = static_cast<int>(sums.padded_offset[nodes[p] + 1] - at);
        HOLBA_WITH_PACKS(padded, (FormTOf<kPacks, kTangent>(chunk.W + w_offset[p], inverse, y,
                                                            sums.reduction + at)));
      }
    }
    const FeatureRun run{f - begin, size_t{first_offset[size]} - first_offset[0]};
    begin = f;
    if constexpr (!kSubtract) continue;
    for (uint32_t p = 0; p < size; ++p) {
      const uint32_t* offsets = chunk.pairs_begin == nullptr
                                    ? nullptr
                                    : chunk.pairs + chunk.pairs_begin[clique - chunk.first_clique] +
                                          size_t{p} * (p + 1) / 2;
      SubtractRow<kTangent>(chunk, sums, nodes, p, offsets, first_offset, run);
    }
  }
}

template <int kTangent>
void AccumulatePlainOf(const Panel& panel, const double* rows, const ChunkFeatures& chunk) {
  const size_t row_stride = panel.row_stride, step = panel.dim * row_stride;
  const double* row = rows;
  for (size_t j = 0; j < panel.count;) {
    const uint32_t f = panel.local_feature[j];
    Pack sum[kTangent][kFeaturePacks];
    for (int i = 0; i < kTangent; ++i) {
      for (int v = 0; v < kFeaturePacks; ++v) sum[i][v] = Broadcast(0.0);
    }
    for (; j < panel.count && panel.local_feature[j] == f; ++j) {
      for (const double* end = row + step; row != end; row += row_stride) {
        for (int v = 0; v < kFeaturePacks; ++v) {
          const Pack x = Load(row + v * kLanes);
          for (int i = 0; i < kTangent; ++i) sum[i][v] += x * row[i];
        }
      }
    }
    double* V = chunk.V + size_t{f} * kTangent * kFeatureRow;
    for (int i = 0; i < kTangent; ++i) {
      for (int v = 0; v < kFeaturePacks; ++v) Store(sum[i][v], V + i * kFeatureRow + v * kLanes);
    }
  }
}

// A diagonal block over a run of features: U += sum E^T E, S -= sum T T^T, which are the same
// matrix in the explicit form. The rows of E of the next feature stand `e_stride` doubles on.
template <int kTangent, int kDim, int kWidth, bool kOneMatrix>
HOLBA_SIMD_INLINE void AddDiagonalBlock(double* U, double* S, const double* E, size_t e_stride,
                                        const double* T, const FeatureRun& run) {
  constexpr int kPadded = PaddedTo8(kWidth), kGrouped = GroupedRows(kWidth);
  constexpr int kRowStride = kFeatureRow + kPadded;
  for (int v = 0; v < kGrouped; v += kLanes) {
    const int at = v / 8 * 8 * kWidth + v % 8;
    Pack sum[kWidth];
    for (int c = 0; c < kWidth; ++c) sum[c] = Load(U + at + c * 8);
    const double *e = E, *t = T;
    for (size_t f = 0; f < run.count; ++f, e += e_stride) {
      for (int k = 0; k < kDim; ++k) {
        const Pack x = Load(e + k * kRowStride + v);
        for (int c = 0; c < kWidth; ++c) sum[c] += x * e[k * kRowStride + c];
      }
    }
    if constexpr (!kOneMatrix) {
      for (int c = 0; c < kWidth; ++c) {
        Store(sum[c], U + at + c * 8);
        sum[c] = Load(S + at + c * 8);
      }
    }
    for (size_t f = 0; f < run.count; ++f, t += run.stride) {
      for (int i = 0; i < kTangent; ++i) {
        const Pack x = Load(t + i * kPadded + v);
        for (int c = 0; c < kWidth; ++c) sum[c] -= x * t[i * kPadded + c];
      }
    }
    for (int c = 0; c < kWidth; ++c) Store(sum[c], S + at + c * 8);
  }
  for (int row = kGrouped; row < kWidth; ++row) {
    const int at = kGrouped * kWidth + (row - kGrouped) * kPadded;
    for (int c = 0; c < kWidth; c += kLanes) {
      Pack sum = Load(U + at + c);
      const double *e = E, *t = T;
      for (size_t f = 0; f < run.count; ++f, e += e_stride) {
        for (int k = 0; k < kDim; ++k)
          sum += Load(e + k * kRowStride + c) * e[k * kRowStride + row];
      }
      if constexpr (!kOneMatrix) {
        Store(sum, U + at + c);
        sum = Load(S + at + c);
      }
      for (size_t f = 0; f < run.count; ++f, t += run.stride) {
        for (int i = 0; i < kTangent; ++i) sum -= Load(t + i * kPadded + c) * t[i * kPadded + row];
      }
      Store(sum, S + at + c);
    }
  }
}

template <int kTangent, int kDim, int kWidth>
void EliminatePlainOf(const double* rows, const ChunkFeatures& chunk, const Sums& sums) {
  constexpr int kEntries = kTangent * (kTangent + 1) / 2;
  constexpr int kPadded = PaddedTo8(kWidth), kRowStride = kFeatureRow + kPadded;
  constexpr size_t kTSize = kTangent * kPadded, kESize = kDim * kRowStride;
  const bool one_matrix = sums.U == sums.S;
  const double* E = rows;
  double* T = chunk.W;
  for (size_t begin = 0; begin < chunk.count;) {
    const uint32_t clique = chunk.clique[begin];
    const uint32_t* nodes = chunk.clique_nodes + chunk.clique_begin[clique];
    const uint32_t size = chunk.clique_begin[clique + 1] - chunk.clique_begin[clique];
    const double* const run_E = E + kFeatureRow;
    const double* const run_T = T;
    size_t f = begin;
    for (; f < chunk.count && chunk.clique[f] == clique; ++f) {
      double inverse[kEntries], y[kTangent];
      for (int k = 0; k < kEntries; ++k) inverse[k] = chunk.factors[k * chunk.stride + f];
      for (int a = 0; a < kTangent; ++a) {
        y[a] = 0.0;
        for (int b = 0; b <= a; ++b)
          y[a] += inverse[a * (a + 1) / 2 + b] * chunk.factors[(kEntries + b) * chunk.stride + f];
      }
      for (uint32_t p = 0; p < size; ++p, E += kESize, T += kTSize) {
        double F[kDim][kTangent];  // F L^-T
        for (int k = 0; k < kDim; ++k) {
          for (int i = 0; i < kTangent; ++i) {
            F[k][i] = E[k * kRowStride] * inverse[i * (i + 1) / 2];
            for (int j = 1; j <= i; ++j)
              F[k][i] += E[k * kRowStride + j] * inverse[i * (i + 1) / 2 + j];
          }
        }
        const uint32_t at = sums.padded_offset[nodes[p]];
        for (int v = 0; v < kPadded; v += kLanes) {
          Pack g = Load(sums.gradient + at + v), d = Load(sums.diagonal + at + v);
          Pack t[kTangent];
          for (int i = 0; i < kTangent; ++i) t[i] = Broadcast(0.0);
          for (int k = 0; k < kDim; ++k) {
            const Pack e = Load(E + k * kRowStride + kFeatureRow + v);
            g += e * E[k * kRowStride + kFeatureRow - 1];
            d += e * e;
            for (int i = 0; i < kTangent; ++i) t[i] += e * F[k][i];
          }
          Store(g, sums.gradient + at + v);
          Store(d, sums.diagonal + at + v);
          Pack reduction = Load(sums.reduction + at + v);
          for (int i = 0; i < kTangent; ++i) {
            reduction += t[i] * y[i];
            Store(t[i], T + i * kPadded + v);
          }
          Store(reduction, sums.reduction + at + v);
        }
      }
    }
    const FeatureRun run{f - begin, size * kTSize};
    begin = f;
    for (uint32_t p = 0; p < size; ++p) {
      const double* const Tp = run_T + p * kTSize;
      const size_t diagonal = size_t{sums.diagonal_offset[nodes[p]]} * kFeatureRow;
      if (one_matrix) {
        AddDiagonalBlock<kTangent, kDim, kWidth, true>(sums.U + diagonal, sums.S + diagonal,
                                                       run_E + p * kESize, size * kESize, Tp, run);
      } else {
        AddDiagonalBlock<kTangent, kDim, kWidth, false>(sums.U + diagonal, sums.S + diagonal,
                                                        run_E + p * kESize, size * kESize, Tp, run);
      }
      if (chunk.pairs_begin == nullptr) {
        for (uint32_t q = 0; q < p; ++q) {
          SubtractSquare<kTangent, kWidth>(sums.S + RowBlockOffset(sums, nodes[p], nodes[q]), Tp,
                                           run_T + q * kTSize, run);
        }
        continue;
      }
      const uint32_t* offsets = chunk.pairs + chunk.pairs_begin[clique - chunk.first_clique] +
                                size_t{p} * (p + 1) / 2;
      for (uint32_t q = 0; q < p; ++q) {
        if (offsets[q] == kNoBlock) continue;
        SubtractSquare<kTangent, kWidth>(sums.S + size_t{offsets[q]} * kFeatureRow, Tp,
                                         run_T + q * kTSize, run);
      }
    }
  }
}

// sum += T_p^T Z T_q, entry (j, i) in its own pack.
template <int kPacks, int kTangent>
HOLBA_SIMD_INLINE void AddQuadratic(const double* Z, const double* Tp, const double* Tq,
                                    int width_q, int padded_q, Pack (&sum)[kTangent][kTangent]) {
  for (int v = 0; v < kPacks; ++v) {
    Pack product[kTangent];
    for (int i = 0; i < kTangent; ++i) product[i] = Broadcast(0.0);
    for (int c = 0; c < width_q; ++c) {
      const Pack z = Load(Z + (c * kPacks + v) * kLanes);
      for (int i = 0; i < kTangent; ++i) product[i] += z * Tq[i * padded_q + c];
    }
    for (int j = 0; j < kTangent; ++j) {
      const Pack t = Load(Tp + (j * kPacks + v) * kLanes);
      for (int i = 0; i < kTangent; ++i) sum[j][i] += t * product[i];
    }
  }
}

template <int kTangent>
void FeatureCovariancesOf(const ChunkFeatures& chunk, const Sums& sums, const double* Z,
                          const size_t* z_offset, const size_t* z_begin, double* covariances) {
  for (size_t f = 0; f < chunk.count; ++f) {
    const uint32_t clique = chunk.clique[f];
    const uint32_t* nodes = chunk.clique_nodes + chunk.clique_begin[clique];
    const uint32_t size = chunk.clique_begin[clique + 1] - chunk.clique_begin[clique];
    const uint32_t* w_offset = chunk.w_offset + chunk.first_position[f];
    const size_t* offset = z_offset + z_begin[f];
    // Lane by lane; added up across lanes at the end.
    Pack off_diagonal[kTangent][kTangent], diagonal[kTangent][kTangent];
    for (int j = 0; j < kTangent; ++j) {
      for (int i = 0; i < kTangent; ++i) off_diagonal[j][i] = diagonal[j][i] = Broadcast(0.0);
    }
    for (uint32_t p = 0; p < size; ++p) {
      const uint32_t a = nodes[p];
      const double* Tp = chunk.W + w_offset[p];
      const int padded_p = static_cast<int>(sums.padded_offset[a + 1] - sums.padded_offset[a]);
      for (uint32_t q = 0; q <= p; ++q, ++offset) {
        const uint32_t b = nodes[q];
        const int padded_q = static_cast<int>(sums.padded_offset[b + 1] - sums.padded_offset[b]);
        HOLBA_WITH_PACKS(padded_p, (AddQuadratic<kPacks, kTangent>(
                                       Z + *offset, Tp, chunk.W + w_offset[q], sums.width[b],
                                       padded_q, q == p ? diagonal : off_diagonal)));
      }
    }
    double inner[kTangent][kTangent] = {};
    for (int j = 0; j < kTangent; ++j) {
      for (int i = 0; i < kTangent; ++i) {
        const double off = Sum(off_diagonal[j][i]);
        inner[j][i] += off + Sum(diagonal[j][i]);
        inner[i][j] += off;
      }
    }
    double L[kTangent][kTangent] = {};  // L^-1
    for (int j = 0; j < kTangent; ++j) {
      for (int i = 0; i <= j; ++i)
        L[j][i] = chunk.factors[(j * (j + 1) / 2 + i) * chunk.stride + f];
      inner[j][j] += 1.0;
    }
    double* out = covariances + f * kTangent * kTangent;
    for (int r = 0; r < kTangent; ++r) {
      for (int c = 0; c < kTangent; ++c) {
        double sum = 0.0;
        for (int j = r; j < kTangent; ++j) {
          for (int i = c; i < kTangent; ++i) sum += L[j][r] * inner[j][i] * L[i][c];
        }
        out[r * kTangent + c] = sum;
      }
    }
  }
}

// One lane per feature.
template <int kTangent>
void SolveFeaturesOf(const ChunkFeatures& chunk, double* h_to_x) {
  constexpr int kEntries = kTangent * (kTangent + 1) / 2;
  constexpr int kRow = (kTangent + kLanes - 1) / kLanes * kLanes;
  int64_t idx[kLanes];
  for (int l = 0; l < kLanes; ++l) idx[l] = l * kFeatureRow;
  for (size_t f = 0; f < chunk.stride; f += kLanes) {
    const auto factor = [&](int k) __attribute__((always_inline)) {
      return Load(chunk.factors + k * chunk.stride + f);
    };
    double* rows = h_to_x + f * kFeatureRow;
    Pack b[kTangent], y[kTangent], x[kRow];
    LoadRows<kTangent>(rows, idx, b);
    for (int i = 0; i < kTangent; ++i) b[i] += factor(kEntries + i);
    for (int i = 0; i < kTangent; ++i) {
      y[i] = factor(i * (i + 1) / 2) * b[0];
      for (int k = 1; k <= i; ++k) y[i] += factor(i * (i + 1) / 2 + k) * b[k];
    }
    for (int i = 0; i < kTangent; ++i) {
      Pack sum = factor(i * (i + 1) / 2 + i) * y[i];
      for (int k = i + 1; k < kTangent; ++k) sum += factor(k * (k + 1) / 2 + i) * y[k];
      x[i] = -sum;
    }
    for (int i = kTangent; i < kRow; ++i) x[i] = Broadcast(0.0);
    for (int i = 0; i < kRow; i += kLanes) {
      Transpose(x + i);
      for (int l = 0; l < kLanes; ++l) Store(x[i + l], rows + l * kFeatureRow + i);
    }
  }
}

template <int kPacks, int kTangent>
HOLBA_SIMD_INLINE void AddDots(const float* T, const double* x, Pack* z) {
  for (int v = 0; v < kPacks; ++v) {
    const Pack xv = Load(x + v * kLanes);
    for (int i = 0; i < kTangent; ++i) z[i] += LoadFloats(T + (i * kPacks + v) * kLanes) * xv;
  }
}
template <int kPacks, int kTangent>
HOLBA_SIMD_INLINE void AddCombination(const float* T, const double* z, double* y) {
  for (int v = 0; v < kPacks; ++v) {
    Pack sum = Load(y + v * kLanes);
    for (int i = 0; i < kTangent; ++i) sum += LoadFloats(T + (i * kPacks + v) * kLanes) * z[i];
    Store(sum, y + v * kLanes);
  }
}

template <int kTangent>
void MultiplyStoredOf(const ChunkFeatures& chunk, const Sums& sums, const float* stored,
                      const double* x, double* y) {
  size_t offset = 0;
  for (size_t f = 0; f < chunk.count; ++f) {
    const uint32_t clique = chunk.clique[f];
    const uint32_t* nodes = chunk.clique_nodes + chunk.clique_begin[clique];
    const uint32_t size = chunk.clique_begin[clique + 1] - chunk.clique_begin[clique];
    Pack sum[kTangent];
    for (int i = 0; i < kTangent; ++i) sum[i] = Broadcast(0.0);
    const float* T = stored + offset;
    for (uint32_t p = 0; p < size; ++p) {
      const uint32_t at = sums.padded_offset[nodes[p]];
      const int padded = static_cast<int>(sums.padded_offset[nodes[p] + 1] - at);
      HOLBA_WITH_PACKS(padded, (AddDots<kPacks, kTangent>(T, x + at, sum)));
      T += kTangent * padded;
    }
    double z[kTangent];
    for (int i = 0; i < kTangent; ++i) z[i] = Sum(sum[i]);
    T = stored + offset;
    for (uint32_t p = 0; p < size; ++p) {
      const uint32_t at = sums.padded_offset[nodes[p]];
      const int padded = static_cast<int>(sums.padded_offset[nodes[p] + 1] - at);
      HOLBA_WITH_PACKS(padded, (AddCombination<kPacks, kTangent>(T, z, y + at)));
      T += kTangent * padded;
    }
    offset = T - stored;
  }
}

}  // namespace

void RowsFromPanel(const Panel& panel, int feature_tangent, double* rows) {
  const int dim = panel.dim, row_stride = panel.row_stride;
  for (int k = 0; k < dim; ++k) {
    const double* column[kMaxRow];
    for (int c = 0; c < row_stride; ++c) column[c] = nullptr;
    for (int i = 0; i < feature_tangent; ++i)
      column[i] = panel.feature_jacobian + (k * feature_tangent + i) * panel.stride;
    column[kFeatureRow - 1] = panel.residuals + k * panel.stride;
    int at = kFeatureRow;
    for (int s = 0; s < panel.num_segments; ++s) {
      const PanelSegment& segment = panel.segments[s];
      for (int p = 0; p < segment.num_parts; ++p) {
        const PanelSegmentPart& part = segment.parts[p];
        for (int c = 0; c < part.count; ++c)
          column[at + part.first + c] =
              part.jacobian + (k * part.tangent + part.columns[c]) * panel.stride;
      }
      at += segment.padded;
    }
    for (size_t j = 0; j < panel.count; j += kLanes) {
      for (int c = 0; c < row_stride; c += kLanes) {
        Pack x[kLanes];
        for (int l = 0; l < kLanes; ++l)
          x[l] = column[c + l] ? Load(column[c + l] + j) : Broadcast(0.0);
        Transpose(x);
        for (int l = 0; l < kLanes; ++l) Store(x[l], rows + ((j + l) * dim + k) * row_stride + c);
      }
    }
  }
}

void BeginChunk(const ChunkFeatures& chunk, const Sums& sums) {
  uint32_t position = 0, offset = 0;
  for (size_t f = 0; f < chunk.count; ++f) {
    chunk.first_position[f] = position;
    const uint32_t clique = chunk.clique[f];
    for (uint32_t p = chunk.clique_begin[clique]; p < chunk.clique_begin[clique + 1]; ++p) {
      const uint32_t node = chunk.clique_nodes[p];
      chunk.w_offset[position++] = offset;
      offset += chunk.tangent * (sums.padded_offset[node + 1] - sums.padded_offset[node]);
    }
  }
  chunk.first_position[chunk.count] = position;
  chunk.w_offset[position] = offset;
  if (chunk.V != nullptr) {
    const size_t size = chunk.stride * chunk.tangent * kFeatureRow;
    for (size_t i = 0; i < size; i += kLanes) Store(Broadcast(0.0), chunk.V + i);
  }
}

void Accumulate(const Panel& panel, const double* rows, const ChunkFeatures& chunk,
                const Sums& sums) {
  HOLBA_WITH_TANGENT(chunk.tangent, (AccumulateOf<kTangent>(panel, rows, chunk, sums)));
}

void AccumulateLoose(const Panel& panel, const double* rows, const uint32_t* cross,
                     const Sums& sums) {
  const int dim = panel.dim, row_stride = panel.row_stride, n = panel.num_segments;
  const int num_cross = n * (n - 1) / 2;
  for (size_t j = 0; j < panel.count; ++j) {
    const double* row = rows + j * dim * row_stride;
    const uint32_t* nodes = panel.nodes + j * n;
    const double* e = row + kFeatureRow;
    int pair = 0;
    for (int s = 0; s < n; e += panel.segments[s].padded, ++s) {
      const PanelSegment& segment = panel.segments[s];
      const uint32_t node = nodes[s];
      if (node != kNoBlock) {
        HOLBA_WITH_PACKS(segment.padded,
                         (AddOwn<kPacks>(row, dim, row_stride, e, segment.width,
                                         sums.U + size_t{sums.diagonal_offset[node]} * kFeatureRow,
                                         sums.gradient + sums.padded_offset[node],
                                         sums.diagonal + sums.padded_offset[node])));
      }
      const double* other = row + kFeatureRow;
      for (int t = 0; t < s; other += panel.segments[t].padded, ++t, ++pair) {
        const uint32_t offset = cross[j * num_cross + pair];
        if (offset == kNoBlock) continue;
        const bool swap = nodes[t] > node;
        const int p = swap ? t : s, q = swap ? s : t;
        const double* ep = swap ? other : e;
        const double* eq = swap ? e : other;
        AddOuter(sums.U + size_t{offset} * kFeatureRow, ep, panel.segments[p].width, eq,
                 panel.segments[q].width, dim, row_stride);
      }
    }
  }
}

ChunkSums FactoriseFeatures(const ChunkFeatures& chunk, double inverse_radius) {
  ChunkSums out;
  HOLBA_WITH_TANGENT(chunk.tangent, (out = FactoriseOf<kTangent>(chunk, inverse_radius)));
  return out;
}

namespace {

void StoreT(const ChunkFeatures& chunk, float* stored) {
  if (stored == nullptr) return;
  const size_t total = chunk.w_offset[chunk.first_position[chunk.count]];
  for (size_t i = 0; i < total; i += kLanes) StoreFloats(Load(chunk.W + i), stored + i);
}

}  // namespace

void FormT(const ChunkFeatures& chunk, const Sums& sums) {
  HOLBA_WITH_TANGENT(chunk.tangent, (EliminateOf<kTangent, false>(chunk, sums)));
}

void Eliminate(const ChunkFeatures& chunk, const Sums& sums, float* stored) {
  HOLBA_WITH_TANGENT(chunk.tangent, (EliminateOf<kTangent, true>(chunk, sums)));
  StoreT(chunk, stored);
}

void AccumulatePlain(const Panel& panel, const double* rows, const ChunkFeatures& chunk) {
  if (chunk.tangent == 3) {
    AccumulatePlainOf<3>(panel, rows, chunk);
  } else {
    AccumulatePlainOf<4>(panel, rows, chunk);
  }
}

void EliminatePlain(const Panel& panel, const double* rows, const ChunkFeatures& chunk,
                    const Sums& sums, float* stored) {
  if (chunk.tangent == 4) {
    EliminatePlainOf<4, 4, 6>(rows, chunk, sums);
  } else if (panel.segments[0].width == 6) {
    EliminatePlainOf<3, 2, 6>(rows, chunk, sums);
  } else {
    EliminatePlainOf<3, 2, 9>(rows, chunk, sums);
  }
  StoreT(chunk, stored);
}

void ApplyStep(const Panel& panel, int feature_tangent, const double* step,
               const int64_t* const* step_base, double* jk, double* pulled) {
  const int dim = panel.dim;
  for (size_t j = 0; j < panel.count; j += kLanes) {
    Pack sum[6];
    for (int k = 0; k < dim; ++k) sum[k] = Broadcast(0.0);
    for (int s = 0; s < panel.num_segments; ++s) {
      const PanelSegment& segment = panel.segments[s];
      Pack d[kMaxSegmentWidth];
      for (int c = 0; c < segment.padded; c += 8) LoadRows<8>(step + c, step_base[s] + j, d + c);
      for (int p = 0; p < segment.num_parts; ++p) {
        const PanelSegmentPart& part = segment.parts[p];
        for (int c = 0; c < part.count; ++c) {
          for (int k = 0; k < dim; ++k)
            sum[k] += d[part.first + c] *
                      Load(part.jacobian + (k * part.tangent + part.columns[c]) * panel.stride + j);
        }
      }
    }
    for (int k = 0; k < dim; ++k) Store(sum[k], jk + k * panel.stride + j);
    for (int i = 0; i < feature_tangent; ++i) {
      Pack q = Broadcast(0.0);
      for (int k = 0; k < dim; ++k)
        q += sum[k] * Load(panel.feature_jacobian + (k * feature_tangent + i) * panel.stride + j);
      Store(q, pulled + i * panel.stride + j);
    }
  }
}

void SolveFeatures(const ChunkFeatures& chunk, double* h_to_x) {
  HOLBA_WITH_TANGENT(chunk.tangent, (SolveFeaturesOf<kTangent>(chunk, h_to_x)));
}

double ModelChange(const Panel& panel, int feature_tangent, const double* jk, const double* x) {
  Pack sum = Broadcast(0.0);
  double rest = 0.0;
  int64_t idx[kLanes];
  for (size_t j = 0; j < panel.count; j += kLanes) {
    const int lanes = Min(kLanes, static_cast<int>(panel.count - j));
    Pack d[kFeatureRow];
    if (feature_tangent > 0) {
      for (int l = 0; l < kLanes; ++l)
        idx[l] = l < lanes ? panel.local_feature[j + l] * kFeatureRow : 0;
      if (feature_tangent <= 4) {
        LoadRows<4>(x, idx, d);
      } else {
        LoadRows<kFeatureRow>(x, idx, d);
      }
    }
    Pack here = Broadcast(0.0);
    for (int k = 0; k < panel.dim; ++k) {
      Pack change = Load(jk + k * panel.stride + j);
      for (int i = 0; i < feature_tangent; ++i)
        change +=
            d[i] * Load(panel.feature_jacobian + (k * feature_tangent + i) * panel.stride + j);
      here += change * (Load(panel.residuals + k * panel.stride + j) + 0.5 * change);
    }
    if (lanes == kLanes) {
      sum += here;
    } else {
      for (int l = 0; l < lanes; ++l) rest += Lane(here, l);
    }
  }
  return Sum(sum) + rest;
}

void FeatureCovariances(const ChunkFeatures& chunk, const Sums& sums, const double* Z,
                        const size_t* z_offset, const size_t* z_begin, double* covariances) {
  HOLBA_WITH_TANGENT(chunk.tangent, (FeatureCovariancesOf<kTangent>(chunk, sums, Z, z_offset,
                                                                    z_begin, covariances)));
}

void AddSumBlock(const double* sum, int width_a, int width_b, bool first, double* block) {
  const int padded = PaddedTo8(width_a), grouped = GroupedRows(width_a);
  for (int group = 0; group < grouped; group += 8) {
    for (int c = 0; c < width_b; ++c, sum += 8) {
      double* to = block + c * padded + group;
      for (int v = 0; v < 8; v += kLanes) {
        Pack x = Load(sum + v);
        if (!first) x += Load(to + v);
        Store(x, to + v);
      }
    }
  }
  for (int row = grouped; row < width_a; ++row, sum += PaddedTo8(width_b)) {
    for (int c = 0; c < width_b; ++c) {
      double* to = block + c * padded + row;
      *to = first ? sum[c] : *to + sum[c];
    }
  }
}

void MultiplyStored(const ChunkFeatures& chunk, const Sums& sums, const float* stored,
                    const double* x, double* y) {
  HOLBA_WITH_TANGENT(chunk.tangent, (MultiplyStoredOf<kTangent>(chunk, sums, stored, x, y)));
}

}  // namespace holba::native::HOLBA_SIMD_TARGET
