// SPDX-License-Identifier: BSD-3-Clause
// elimination.h: transposing panels into rows, and summing up V, g, U and W.
#include <utility>

#include "holba/solver/native/elimination_packs.h"

namespace holba::native::HOLBA_SIMD_TARGET {
namespace {

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
  const int padded = PaddedWidth(width_b);
  for (int row = grouped; row < width_a; ++row, tail += padded) {
    for (int c = 0; c < width_b; c += kLanes) {
      Pack sum = Load(tail + c);
      for (int k = 0; k < kDim; ++k) sum += Load(b + k * row_stride + c) * a[k * row_stride + row];
      Store(sum, tail + c);
    }
  }
}
// The same for blocks of at most 8 rows and kColumns columns.
template <int kDim, int kColumns>
HOLBA_SIMD_INLINE void AddNarrowOuterOf(double* block, const double* a, const double* b,
                                        int row_stride) {
  for (int v = 0; v < 8; v += kLanes) {
    Pack e[kDim];
    for (int k = 0; k < kDim; ++k) e[k] = Load(a + k * row_stride + v);
    for (int c = 0; c < kColumns; ++c) {
      Pack sum = Load(block + c * 8 + v);
      for (int k = 0; k < kDim; ++k) sum += e[k] * b[k * row_stride + c];
      Store(sum, block + c * 8 + v);
    }
  }
}
template <int kDim>
HOLBA_SIMD_INLINE void AddOuterOfDim(double* block, const double* a, int width_a, const double* b,
                                     int width_b, int row_stride) {
  if (width_a <= 8) {
    // Poses, planes and vanishing points.
    if (width_b == 6) return AddNarrowOuterOf<kDim, 6>(block, a, b, row_stride);
    if (width_b == 3) return AddNarrowOuterOf<kDim, 3>(block, a, b, row_stride);
    if (width_b == 2) return AddNarrowOuterOf<kDim, 2>(block, a, b, row_stride);
  }
  AddOuterOf<kDim>(block, a, width_a, b, width_b, row_stride);
}
HOLBA_SIMD_INLINE void AddOuter(double* block, const double* a, int width_a, const double* b,
                                int width_b, int dim, int row_stride) {
  if (dim == 2) return AddOuterOfDim<2>(block, a, width_a, b, width_b, row_stride);
  if (dim == 4) return AddOuterOfDim<4>(block, a, width_a, b, width_b, row_stride);
  for (int k = 0; k < dim; ++k)
    AddOuterOfDim<1>(block, a + k * row_stride, width_a, b + k * row_stride, width_b, row_stride);
}

// Adds one segment of one residual to g, to the diagonal of U and to the diagonal block of U.
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

// W(:, i) += E^T F(:, i), or = at the first touch.
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

// Block of the nodes a >= b, which have the positions p and q in the clique; null: the form leaves
// it out.
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

// Accumulate for residuals of one segment whose sizes are constants.
template <int kTangent, int kDim, int kWidth>
void AccumulateAlone(const Panel& panel, const double* rows, const ChunkFeatures& chunk,
                     const Sums& sums) {
  constexpr int kPadded = PaddedWidth(kWidth), kPacks = kPadded / kLanes;
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
      if (sums.U == nullptr) continue;
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

template <int kTangent, int kShape>
HOLBA_SIMD_INLINE bool AccumulateIfShape(const Panel& panel, const double* rows,
                                         const ChunkFeatures& chunk, const Sums& sums) {
  constexpr ResidualShape shape = kConstantShapes[kShape];
  if constexpr (shape.tangent == kTangent) {
    if (!IsShape(shape, kTangent, panel.dim, panel.segments[0].width)) return false;
    AccumulateAlone<kTangent, shape.dim, shape.width>(panel, rows, chunk, sums);
    return true;
  } else {
    return false;
  }
}
// False: not a constant shape, nothing was done.
template <int kTangent, int... kShape>
HOLBA_SIMD_INLINE bool AccumulateIfAlone(const Panel& panel, const double* rows,
                                         const ChunkFeatures& chunk, const Sums& sums,
                                         std::integer_sequence<int, kShape...>) {
  return (AccumulateIfShape<kTangent, kShape>(panel, rows, chunk, sums) || ...);
}

template <int kTangent>
void AccumulateOf(const Panel& panel, const double* rows, const ChunkFeatures& chunk,
                  const Sums& sums) {
  if (panel.num_segments == 1 &&
      AccumulateIfAlone<kTangent>(panel, rows, chunk, sums,
                                  std::make_integer_sequence<int, kNumConstantShapes>()))
    return;
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
        HOLBA_WITH_PACKS(segment.padded,
                         (AddW<kPacks, kTangent>(row, dim, row_stride, e, first, W)));
        if (sums.U == nullptr) continue;
        double* block = sums.U + size_t{sums.diagonal_offset[node]} * kFeatureRow;
        double* gradient = sums.gradient + sums.padded_offset[node];
        double* diagonal = sums.diagonal + sums.padded_offset[node];
        HOLBA_WITH_PACKS(segment.padded, (AddOwn<kPacks>(row, dim, row_stride, e, segment.width,
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
          double* pair =
              PairBlock(sums, chunk, clique, sums.U, later, earlier, nodes[later], nodes[earlier]);
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
      if (node != kNoNode) {
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

void AccumulatePlain(const Panel& panel, const double* rows, const ChunkFeatures& chunk) {
  HOLBA_WITH_TANGENT(chunk.tangent, (AccumulatePlainOf<kTangent>(panel, rows, chunk)));
}

}  // namespace holba::native::HOLBA_SIMD_TARGET
