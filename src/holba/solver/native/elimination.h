// SPDX-License-Identifier: BSD-3-Clause
// The inner loops of the native solver: the Schur complement, feature by feature, in one pass over
// the residuals. README.md in this folder has an example and a glossary.
//
// A residual of feature f has the value r, the Jacobian F with respect to the feature, whose
// tangent size is also called F, and the Jacobian E_p with respect to each node p that it touches.
// The robust loss and the weight have been applied: r, F and E_p are multiplied by sqrt(w rho').
// With the damping D of Levenberg-Marquardt (Marquardt 1963) the normal equations of a step (k, x)
// are
//
//   [ U + D_k   W       ] [k]     [g_k]      U   = sum E^T E,  W_pf = sum E_p^T F
//   [ W^T       V + D_f ] [x] = - [g_f]      V_f = sum F^T F,  g = sum (E, F)^T r
//
// where k is the step of the kept unknowns and x that of the features. V is block-diagonal with one
// block per feature. With V_f + D_f = L L^T, T_pf = W_pf L^-T and y_f = L^-1 g_f the reduced system
// is
//
//   S k = -(g_k - sum_f T_f y_f),   S = U + D_k - sum_f T_f T_f^T                  (Brown 1958)
//
// and x_f = -L^-T (y_f + T_f^T k) = -L^-T L^-1 (g_f + sum F^T (E k)).
//
// The solver works on a chunk of features in four steps:
//   1. It evaluates the residuals into panels, one vector lane per residual.
//   2. It transposes the panels into rows, one vector per row of a Jacobian.
//   3. It sums up V, g, U and W feature by feature.
//   4. It factorises V, one vector lane per feature, forms T and subtracts its products from S.
// Only L^-1 and g of the features are stored. Back-substitution evaluates the Jacobians again,
// which costs less than writing and reading them.
//
// Files that are compiled for several instruction sets include this header, so it has plain
// pointers only.
#pragma once

#include <cstddef>
#include <cstdint>

#include "holba/linear/padding.h"
#include "holba/simd/targets.h"

namespace holba::native {

// A row of a residual begins with 8 doubles: the F entries of the feature's Jacobian, zeros, and
// the residual itself last.
inline constexpr int kFeatureRow = 8;
// The position of a residual's segment is the place of its node in the feature's clique. The flag
// kFirstTouch marks the first residual of a chunk that touches a block of W: it sets the block, the
// others add to it.
inline constexpr uint16_t kNoPosition = 0xFFFF;  // the segment's blocks are constant
inline constexpr uint16_t kFirstTouch = 0x8000, kPositionMask = 0x7FFF;
inline constexpr uint16_t kMaxPositions = 0x7FFF;
inline constexpr int kMaxPanelSegments = 5;
inline constexpr uint32_t kNoNode = ~uint32_t{0};   // instead of a node: the blocks are constant
inline constexpr uint32_t kNoBlock = ~uint32_t{0};  // instead of a block: the form leaves it out

struct PanelSegmentPart {
  const double* jacobian =
      nullptr;  // entry (row, coordinate) at [(row * tangent + coordinate) * stride]
  int tangent = 0;
  int first = 0;  // column in the segment
  int count = 0;
  const uint8_t* columns = nullptr;  // tangent coordinate of each
};
struct PanelSegment {
  int width = 0, padded = 0;
  int num_parts = 0;
  PanelSegmentPart parts[2];
};

// The residuals of one part in one chunk, evaluated and multiplied by their weights.
struct Panel {
  int dim = 0;
  size_t count = 0, stride = 0;
  const double* residuals = nullptr;         // dim x stride
  const double* feature_jacobian = nullptr;  // (dim * F) x stride
  int num_segments = 0;
  PanelSegment segments[kMaxPanelSegments];
  const uint16_t* local_feature = nullptr;
  const uint16_t* positions = nullptr;  // count x num_segments, with kFirstTouch
  const uint32_t* nodes = nullptr;      // residuals without a feature: count x num_segments
  int row_stride = 0;
};

// The sums of a slice store a w_a x w_b block of the reduced system in groups of 8 rows, each group
// column by column. Up to 3 rows beyond the last full group are stored row by row in padded rows: a
// pose with its own intrinsics has 9 to 11 unknowns, so padding it to 16 rows would nearly double
// the memory, and memory limits these sums.
inline constexpr int kMaxTailRows = 3;
constexpr int TailRows(int width) {
  return width >= 8 && width % 8 <= kMaxTailRows ? width % 8 : 0;
}
constexpr int GroupedRows(int width) { return PaddedWidth(width - TailRows(width)); }
constexpr size_t SumBlockSize(int width_a, int width_b) {
  return static_cast<size_t>(GroupedRows(width_a)) * width_b +
         static_cast<size_t>(TailRows(width_a)) * PaddedWidth(width_b);
}

// Sums of one slice. Vectors are padded: the entries of node n begin at padded_offset[n].
struct Sums {
  double* U = nullptr;          // blocks of U; null: only V, g and W are summed up
  double* S = nullptr;          // blocks of S - U; may be the same memory as U
  double* gradient = nullptr;   // g_k
  double* diagonal = nullptr;   // of U
  double* reduction = nullptr;  // sum T y
  const uint32_t* padded_offset = nullptr;
  const int* width = nullptr;
  // Offset of the diagonal block of each node, in units of kFeatureRow doubles.
  const uint32_t* diagonal_offset = nullptr;
  // Full pattern: block (a, b) at row_offset[a] + the sizes of the blocks (a, 0) ... (a, b - 1).
  const size_t* row_offset = nullptr;
  const uint32_t* unknown_offset = nullptr;
  bool diagonal_only = false;  // elimination subtracts from diagonal blocks of S only
};

// The features of a chunk.
struct ChunkFeatures {
  int tangent = 0;  // F
  size_t count = 0, stride = 0;
  const uint32_t* clique = nullptr;        // of each feature
  const uint32_t* clique_begin = nullptr;  // cliques
  const uint32_t* clique_nodes = nullptr;
  const size_t* pairs_begin = nullptr;  // per clique; null: full pattern
  const uint32_t* pairs = nullptr;      // kNoBlock: not kept
  uint32_t first_clique = 0;            // of pairs_begin
  // Scratch memory of one chunk.
  uint32_t* first_position = nullptr;  // count + 1
  uint32_t* w_offset = nullptr;        // by position
  double* W = nullptr;
  double* V = nullptr;  // count x F x kFeatureRow
  // Stored for back-substitution: L^-1 (lower triangle by rows), then g; entry k of feature i at
  // [k * stride + i].
  double* factors = nullptr;
};

struct ChunkSums {
  double max_gradient = 0.0;  // largest absolute entry of g_f over the features of the chunk
};

// Transposes a panel into rows: row k of residual j at rows + (j * dim + k) * row_stride.
HOLBA_SIMD_DECLARE(void RowsFromPanel(const Panel& panel, int feature_tangent, double* rows))
// Fills first_position and w_offset, and sets V to zero.
HOLBA_SIMD_DECLARE(void BeginChunk(const ChunkFeatures& chunk, const Sums& sums))
// Adds to V, g, W, U, g_k and the diagonal of U; the last three only where there is a U.
HOLBA_SIMD_DECLARE(void Accumulate(const Panel& panel, const double* rows,
                                   const ChunkFeatures& chunk, const Sums& sums))
// Adds residuals without a feature to U, g_k and the diagonal of U. cross: for each residual the
// offsets of the blocks of its pairs of segments (1,0), (2,0), (2,1), ...; kNoBlock where a segment
// has no node.
HOLBA_SIMD_DECLARE(void AccumulateLoose(const Panel& panel, const double* rows,
                                        const uint32_t* cross, const Sums& sums))
// Residuals of one segment whose sizes are constants at compile time: points and lines seen by
// poses, points seen by poses with their own intrinsics, and the distances of the wireframe.
struct ResidualShape {
  int tangent, dim, width;  // F, of the residual, of the node
};
inline constexpr ResidualShape kConstantShapes[] = {
    {3, 2, 6}, {3, 2, 9}, {4, 4, 6}, {3, 1, 6}, {4, 1, 6}};
inline constexpr int kNumConstantShapes = sizeof(kConstantShapes) / sizeof(kConstantShapes[0]);
constexpr bool IsShape(const ResidualShape& shape, int tangent, int dim, int width) {
  return shape.tangent == tangent && shape.dim == dim && shape.width == width;
}

// Plain chunks. Where each feature has exactly one residual for each node of its clique, in the
// order of the clique, all of one part and of a constant shape, W = E^T F need not be formed:
// T_pf = E_p^T (F L^-T), and the diagonal blocks take E^T E - T T^T in one pass. Most observations
// of points and lines are of this form.
// Sets V and g.
HOLBA_SIMD_DECLARE(void AccumulatePlain(const Panel& panel, const double* rows,
                                        const ChunkFeatures& chunk))
// Does the rest of Accumulate, and Eliminate.
HOLBA_SIMD_DECLARE(void EliminatePlain(const Panel& panel, const double* rows,
                                       const ChunkFeatures& chunk, const Sums& sums, float* stored))

// Computes L^-1 of V + D, D = max(diag V, floor) / radius with floor = 1e-6 (1 + sqrt(V_ii))^2.
// This is the damping of Ceres, which scales the Jacobian columns by 1 / (1 + sqrt(V_ii)).
HOLBA_SIMD_DECLARE(ChunkSums FactoriseFeatures(const ChunkFeatures& chunk, double inverse_radius))
// Forms T in the place of W and adds T y to the reduction.
HOLBA_SIMD_DECLARE(void FormT(const ChunkFeatures& chunk, const Sums& sums))
// The same, and subtracts T T^T from S. Unless `stored` is null, T is copied to it in single
// precision: F x padded entries per position, in the order of the positions.
HOLBA_SIMD_DECLARE(void Eliminate(const ChunkFeatures& chunk, const Sums& sums, float* stored))

// Back-substitution: jk = E k (dim x stride) and pulled = F^T (E k) (F x stride). `step` is k as a
// padded vector, with zeros beyond its end; step_base has, for each segment, `stride` entries:
// where in `step` the entries of the residual's node begin.
HOLBA_SIMD_DECLARE(void ApplyStep(const Panel& panel, int feature_tangent, const double* step,
                                  const int64_t* const* step_base, double* jk, double* pulled))
// x = -L^-T L^-1 (g + h), in place: h and x have a row of kFeatureRow per feature, up to the
// chunk's stride.
HOLBA_SIMD_DECLARE(void SolveFeatures(const ChunkFeatures& chunk, double* h_to_x))
// Change of the cost that the linear model predicts for the whole step d: the sum of
// (J d) . (r + J d / 2).
HOLBA_SIMD_DECLARE(double ModelChange(const Panel& panel, int feature_tangent, const double* jk,
                                      const double* x))

// Covariances of the features of a chunk, L^-T (I + T^T Z T) L^-1, after FormT: F x F entries of
// feature i at covariances[i * F * F]. Z has the blocks of S^-1 as the values of a BlockMatrix with
// zeros in its padding; z_offset has, from z_begin[i] on, the offsets of the blocks of the pairs
// (p, q <= p) of the clique of feature i.
HOLBA_SIMD_DECLARE(void FeatureCovariances(const ChunkFeatures& chunk, const Sums& sums,
                                           const double* Z, const size_t* z_offset,
                                           const size_t* z_begin, double* covariances))

// Adds a block of the sums to a block of a BlockMatrix, width_b columns of PaddedWidth(width_a)
// doubles; `first`: overwrites it instead.
HOLBA_SIMD_DECLARE(void AddSumBlock(const double* sum, int width_a, int width_b, bool first,
                                    double* block))

// y += T (T^T x) for the features of a chunk, from stored T; x and y are padded vectors.
HOLBA_SIMD_DECLARE(void MultiplyStored(const ChunkFeatures& chunk, const Sums& sums,
                                       const float* stored, const double* x, double* y))

}  // namespace holba::native
