// SPDX-License-Identifier: BSD-3-Clause
// elimination.h: factorising V, forming T, and subtracting T T^T from S.
#include <utility>

#include "holba/solver/native/elimination_packs.h"

namespace holba::native::HOLBA_SIMD_TARGET {
namespace {

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
      // A direction that no residual constrains gets a zero step.
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

// L^-1 and y = L^-1 g of a feature.
template <int kTangent>
HOLBA_SIMD_INLINE void LoadFactor(const ChunkFeatures& chunk, size_t f, double* inverse,
                                  double* y) {
  constexpr int kEntries = kTangent * (kTangent + 1) / 2;
  for (int k = 0; k < kEntries; ++k) inverse[k] = chunk.factors[k * chunk.stride + f];
  for (int a = 0; a < kTangent; ++a) {
    y[a] = 0.0;
    for (int b = 0; b <= a; ++b)
      y[a] += inverse[a * (a + 1) / 2 + b] * chunk.factors[(kEntries + b) * chunk.stride + f];
  }
}

// W -> T = W L^-T in place; reduction += T y.
template <int kPacks, int kTangent>
HOLBA_SIMD_INLINE void FormTOf(double* W, const double* inverse, const double* y,
                               double* reduction) {
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

// Consecutive features with the same clique. T of the next feature begins `stride` doubles later
// and has the same order, so the products of all are summed up in registers before S is written
// once.
struct FeatureRun {
  size_t count;
  size_t stride;
};

// Subtracts T_p T_q^T, summed over the run, from 8 rows and kColumns columns of a block.
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

// S(p, q) -= T_p T_q^T, summed over the run.
template <int kTangent>
__attribute__((noinline)) void SubtractPair(double* block, int width_p, const double* Tp,
                                            int width_q, const double* Tq, const FeatureRun& run) {
  const int padded_p = PaddedWidth(width_p), padded_q = PaddedWidth(width_q);
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

// The same for two nodes of the width kWidth, so that every stride is a constant.
template <int kTangent, int kWidth>
HOLBA_SIMD_INLINE void SubtractSquare(double* block, const double* Tp, const double* Tq,
                                      const FeatureRun& run) {
  constexpr int kPadded = PaddedWidth(kWidth), kGrouped = GroupedRows(kWidth);
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

// S(p, q) -= T_p T_q^T for all q <= p of the clique.
template <int kTangent>
void SubtractRow(const ChunkFeatures& chunk, const Sums& sums, const uint32_t* nodes, uint32_t p,
                 const uint32_t* offsets, const uint32_t* w_offset, const FeatureRun& run) {
  const uint32_t a = nodes[p];
  const int width = sums.width[a];
  const double* Tp = chunk.W + w_offset[p];
  for (uint32_t q = sums.diagonal_only ? p : 0; q <= p; ++q) {
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
      LoadFactor<kTangent>(chunk, f, inverse, y);
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

// U += E^T E and S -= T T^T, summed over the run, for a diagonal block; U and S are the same matrix
// in the explicit form (kOneMatrix). The rows of E of the next feature begin `e_stride` doubles
// later.
template <int kTangent, int kDim, int kWidth, bool kOneMatrix>
HOLBA_SIMD_INLINE void AddDiagonalBlock(double* U, double* S, const double* E, size_t e_stride,
                                        const double* T, const FeatureRun& run) {
  constexpr int kPadded = PaddedWidth(kWidth), kGrouped = GroupedRows(kWidth);
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
  constexpr int kPadded = PaddedWidth(kWidth), kRowStride = kFeatureRow + kPadded;
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
      LoadFactor<kTangent>(chunk, f, inverse, y);
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
      if (sums.diagonal_only) continue;
      if (chunk.pairs_begin == nullptr) {
        for (uint32_t q = 0; q < p; ++q) {
          SubtractSquare<kTangent, kWidth>(sums.S + RowBlockOffset(sums, nodes[p], nodes[q]), Tp,
                                           run_T + q * kTSize, run);
        }
        continue;
      }
      const uint32_t* offsets =
          chunk.pairs + chunk.pairs_begin[clique - chunk.first_clique] + size_t{p} * (p + 1) / 2;
      for (uint32_t q = 0; q < p; ++q) {
        if (offsets[q] == kNoBlock) continue;
        SubtractSquare<kTangent, kWidth>(sums.S + size_t{offsets[q]} * kFeatureRow, Tp,
                                         run_T + q * kTSize, run);
      }
    }
  }
}

template <int... kShape>
void EliminatePlainAmong(const Panel& panel, const double* rows, const ChunkFeatures& chunk,
                         const Sums& sums, std::integer_sequence<int, kShape...>) {
  const auto eliminate_if = [&]<int kIdx>() {
    constexpr ResidualShape shape = kConstantShapes[kIdx];
    if (!IsShape(shape, chunk.tangent, panel.dim, panel.segments[0].width)) return false;
    EliminatePlainOf<shape.tangent, shape.dim, shape.width>(rows, chunk, sums);
    return true;
  };
  (eliminate_if.template operator()<kShape>() || ...);
}

void StoreT(const ChunkFeatures& chunk, float* stored) {
  if (stored == nullptr) return;
  const size_t total = chunk.w_offset[chunk.first_position[chunk.count]];
  for (size_t i = 0; i < total; i += kLanes) StoreFloats(Load(chunk.W + i), stored + i);
}

}  // namespace

ChunkSums FactoriseFeatures(const ChunkFeatures& chunk, double inverse_radius) {
  ChunkSums out;
  HOLBA_WITH_TANGENT(chunk.tangent, (out = FactoriseOf<kTangent>(chunk, inverse_radius)));
  return out;
}

void FormT(const ChunkFeatures& chunk, const Sums& sums) {
  HOLBA_WITH_TANGENT(chunk.tangent, (EliminateOf<kTangent, false>(chunk, sums)));
}

void Eliminate(const ChunkFeatures& chunk, const Sums& sums, float* stored) {
  HOLBA_WITH_TANGENT(chunk.tangent, (EliminateOf<kTangent, true>(chunk, sums)));
  StoreT(chunk, stored);
}

void EliminatePlain(const Panel& panel, const double* rows, const ChunkFeatures& chunk,
                    const Sums& sums, float* stored) {
  EliminatePlainAmong(panel, rows, chunk, sums,
                      std::make_integer_sequence<int, kNumConstantShapes>());
  StoreT(chunk, stored);
}

void AddSumBlock(const double* sum, int width_a, int width_b, bool first, double* block) {
  const int padded = PaddedWidth(width_a), grouped = GroupedRows(width_a);
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
  for (int row = grouped; row < width_a; ++row, sum += PaddedWidth(width_b)) {
    for (int c = 0; c < width_b; ++c) {
      double* to = block + c * padded + row;
      *to = first ? sum[c] : *to + sum[c];
    }
  }
}

}  // namespace holba::native::HOLBA_SIMD_TARGET
