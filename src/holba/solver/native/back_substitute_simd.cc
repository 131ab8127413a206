// SPDX-License-Identifier: BSD-3-Clause
// elimination.h: back-substitution, products with S, and covariances of the features.
#include "holba/solver/native/elimination_packs.h"

namespace holba::native::HOLBA_SIMD_TARGET {
namespace {

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

// sum += T_p^T Z T_q; each entry (j, i) has a pack of partial sums.
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
    // One sum per lane; the lanes are added up at the end.
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

}  // namespace

void ApplyStep(const Panel& panel, int feature_tangent, const double* step,
               const int64_t* const* step_base, double* jk, double* pulled) {
  const int dim = panel.dim;
  for (size_t j = 0; j < panel.count; j += kLanes) {
    Pack sum[6];
    for (int k = 0; k < dim; ++k) sum[k] = Broadcast(0.0);
    for (int s = 0; s < panel.num_segments; ++s) {
      const PanelSegment& segment = panel.segments[s];
      Pack d[kMaxBlockWidth];
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

void MultiplyStored(const ChunkFeatures& chunk, const Sums& sums, const float* stored,
                    const double* x, double* y) {
  HOLBA_WITH_TANGENT(chunk.tangent, (MultiplyStoredOf<kTangent>(chunk, sums, stored, x, y)));
}

void FeatureCovariances(const ChunkFeatures& chunk, const Sums& sums, const double* Z,
                        const size_t* z_offset, const size_t* z_begin, double* covariances) {
  HOLBA_WITH_TANGENT(chunk.tangent, (FeatureCovariancesOf<kTangent>(chunk, sums, Z, z_offset,
                                                                    z_begin, covariances)));
}

}  // namespace holba::native::HOLBA_SIMD_TARGET
