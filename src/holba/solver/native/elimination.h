// SPDX-License-Identifier: BSD-3-Clause
// The Schur complement, one feature at a time, in one fused pass over the residuals.
//
// Residual i of feature f has the value r (weighted: times sqrt(w rho'), like its Jacobians), the
// Jacobian F by the feature (tangent size F too) and E_p by each node p that it touches. With the
// damping D of Levenberg-Marquardt (Marquardt 1963), the normal equations of a step (k, x) are
//
//   [ U + D_k   W       ] [k]     [g_k]      U   = sum E^T E,  W_pf = sum E_p^T F
//   [ W^T       V + D_f ] [x] = - [g_f]      V_f = sum F^T F,  g = sum (E, F)^T r
//
// V is block-diagonal, a block per feature. With V_f + D_f = L L^T, T_pf = W_pf L^-T and
// y_f = L^-1 g_f the reduced system is
//
//   S k = -(g_k - sum_f T_f y_f),   S = U + D_k - sum_f T_f T_f^T                  (Brown 1958)
//
// and x_f = -L^-T (y_f + T_f^T k) = -L^-T L^-1 (g_f + sum F^T (E k)).
//
// A chunk of features is worked on in four steps: evaluate its residuals into panels (one vector
// lane per residual); turn the panels into rows (one vector per row of a Jacobian); sum up V, g, U
// and W feature by feature; factorise V (one lane per feature), form T and subtract its products
// from S. Nothing of a chunk is kept but L^-1 and g of its features: back-substitution evaluates
// the Jacobians again, which costs less than to write and read them.
//
// This header is shared with code compiled for several instruction sets: plain pointers only.
#pragma once

#include <cstddef>
#include <cstdint>

#include "holba/linear/padding.h"
#include "holba/simd/targets.h"

namespace holba::native {

// Feature rows: F entries, zeros, and the residual last.
inline constexpr int kFeatureRow = 8;
// Of a residual's segment: its node's place in the feature's clique, and whether the residual is
// the first of its chunk that touches that W, which it then sets instead of adding to it.
inline constexpr uint16_t kNoPosition = 0xFFFF;  // the blocks do not move
inline constexpr uint16_t kFirstTouch = 0x8000, kPositionMask = 0x7FFF;
inline constexpr uint16_t kMaxPositions = 0x7FFF;
inline constexpr int kMaxPanelSegments = 4;

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

// The residuals of one part in one chunk, evaluated and weighted.
struct Panel {
  int dim = 0;
  size_t count = 0, stride = 0;
  const double* residuals = nullptr;         // dim x stride
  const double* feature_jacobian = nullptr;  // (dim * F) x stride
  int num_segments = 0;
  PanelSegment segments[kMaxPanelSegments];
  const uint16_t* local_feature = nullptr;
  const uint16_t* positions = nullptr;  // count x num_segments, with kFirstTouch
  const uint32_t* nodes = nullptr;      // the same without a feature
  int row_stride = 0;
};

// How the sums of a slice store a block of the reduced system, w_a x w_b: rows in groups of 8, a
// group column by column; up to 3 rows beyond the last full group row by row, in padded rows. A
// pose with its own intrinsics has 9 to 11 unknowns: padded to 16 rows it would take twice the
// memory, and memory is what limits these sums.
inline constexpr int kMaxTailRows = 3;
constexpr int TailRows(int width) {
  return width >= 8 && width % 8 <= kMaxTailRows ? width % 8 : 0;
}
constexpr int GroupedRows(int width) { return PaddedWidth(width - TailRows(width)); }
constexpr size_t SumBlockSize(int width_a, int width_b) {
  return static_cast<size_t>(GroupedRows(width_a)) * width_b +
         static_cast<size_t>(TailRows(width_a)) * PaddedWidth(width_b);
}

// Sums of one slice. Vectors are padded: node n has the entries padded_offset[n] and following.
struct Sums {
  double* U = nullptr;          // blocks of the reduced system, before elimination ...
  double* S = nullptr;          // ... and what is added to it by elimination; may be the same
  double* gradient = nullptr;   // g_k
  double* diagonal = nullptr;   // of U
  double* reduction = nullptr;  // sum T y
  const uint32_t* padded_offset = nullptr;
  const int* width = nullptr;
  // Offsets of blocks, in units of kFeatureRow doubles.
  const uint32_t* diagonal_offset = nullptr;  // by node
  // Full pattern: block (a, b) at row_offset[a] + the sizes of the blocks (a, 0) ... (a, b - 1).
  const size_t* row_offset = nullptr;
  const uint32_t* unknown_offset = nullptr;
  bool diagonal_only = false;  // elimination subtracts from diagonal blocks of S only
};
inline constexpr uint32_t kNoBlock = ~uint32_t{0};

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
  uint32_t* first_position = nullptr;   // scratch, count + 1
  uint32_t* w_offset = nullptr;         // scratch, per position
  double* W = nullptr;                  // scratch
  double* V = nullptr;                  // scratch, count x F x kFeatureRow
  // Kept: L^-1 (lower triangle by rows), then g; entry k of feature i at [k * stride + i].
  double* factors = nullptr;
};

// What a chunk adds to the step's figures.
struct ChunkSums {
  double max_gradient = 0.0;  // largest entry of any g_f
};

// Panels to rows: row k of residual j at rows + (j * dim + k) * row_stride.
HOLBA_SIMD_DECLARE(void RowsFromPanel(const Panel& panel, int feature_tangent, double* rows))
// Fills first_position, w_offset; zeroes V.
HOLBA_SIMD_DECLARE(void BeginChunk(const ChunkFeatures& chunk, const Sums& sums))
// V, g, W, U, g_k and the diagonal of U.
HOLBA_SIMD_DECLARE(void Accumulate(const Panel& panel, const double* rows,
                                   const ChunkFeatures& chunk, const Sums& sums))
// Residuals without a feature: U, g_k, the diagonal of U. cross: offsets of the pairs of segments
// (1,0), (2,0), (2,1), ... of each residual, kNoBlock where one does not move.
HOLBA_SIMD_DECLARE(void AccumulateLoose(const Panel& panel, const double* rows,
                                        const uint32_t* cross, const Sums& sums))
// Residuals of one segment whose sizes are constants to the compiler: points and lines seen by
// poses or by poses with intrinsics of their own, and the wireframe's distances.
struct ResidualShape {
  int tangent, dim, width;  // F, of the residual, of the node
};
inline constexpr ResidualShape kConstantShapes[] = {
    {3, 2, 6}, {3, 2, 9}, {4, 4, 6}, {3, 1, 6}, {4, 1, 6}};
inline constexpr int kNumConstantShapes = sizeof(kConstantShapes) / sizeof(kConstantShapes[0]);
constexpr bool IsShape(const ResidualShape& shape, int tangent, int dim, int width) {
  return shape.tangent == tangent && shape.dim == dim && shape.width == width;
}

// Where each place in a feature's clique has one residual, all of one part, of a constant shape and
// in the order of the clique, as the observations of points and lines, W is never formed:
// T_pf = E_p^T (F L^-T), and the diagonal blocks take E^T E and -T T^T in one go.
// V and g.
HOLBA_SIMD_DECLARE(void AccumulatePlain(const Panel& panel, const double* rows,
                                        const ChunkFeatures& chunk))
// All the rest of Accumulate, and Eliminate.
HOLBA_SIMD_DECLARE(void EliminatePlain(const Panel& panel, const double* rows,
                                       const ChunkFeatures& chunk, const Sums& sums, float* stored))

// L^-1 of V + max(diag V, floor) / radius, floor = 1e-6 (1 + sqrt(V_ii))^2 (as Ceres, whose columns
// are scaled by 1 / (1 + sqrt(V_ii))).
HOLBA_SIMD_DECLARE(ChunkSums FactoriseFeatures(const ChunkFeatures& chunk, double inverse_radius))
// T into W's place; adds to the reduction.
HOLBA_SIMD_DECLARE(void FormT(const ChunkFeatures& chunk, const Sums& sums))
// The same, and subtracts from S. T is copied, in single precision,
// to `stored` (F x padded entries per position, positions in order) unless it is null.
HOLBA_SIMD_DECLARE(void Eliminate(const ChunkFeatures& chunk, const Sums& sums, float* stored))

// Back-substitution. step_base: for each segment, stride entries: where in `step` (padded vector of
// the kept unknowns, with zeros where nothing moves) the node's entries begin. jk (dim x stride):
// E k. pulled (F x stride): F^T (E k).
HOLBA_SIMD_DECLARE(void ApplyStep(const Panel& panel, int feature_tangent, const double* step,
                                  const int64_t* const* step_base, double* jk, double* pulled))
// x = -L^-T L^-1 (g + h), h and x as rows of kFeatureRow per feature, up to the chunk's stride (h
// becomes x).
HOLBA_SIMD_DECLARE(void SolveFeatures(const ChunkFeatures& chunk, double* h_to_x))
// sum of (Jd) . (r + Jd / 2), d the whole step: minus the decrease that the linear model promises.
HOLBA_SIMD_DECLARE(double ModelChange(const Panel& panel, int feature_tangent, const double* jk,
                                      const double* x))

// Covariances of the features of a chunk, L^-T (I + T^T Z T) L^-1 with Z = S^-1 on the blocks of S,
// T where FormT left it: F x F entries of feature i at covariances[i * F * F]. Z is a BlockMatrix's
// values, zeros in its padding; z_offset: of the blocks of the pairs (p, q <= p) of each feature's
// clique, from z_begin[i] on.
HOLBA_SIMD_DECLARE(void FeatureCovariances(const ChunkFeatures& chunk, const Sums& sums,
                                           const double* Z, const size_t* z_offset,
                                           const size_t* z_begin, double* covariances))

// A block of sums added to (or, `first`, put into) a block of BlockMatrix: width_b columns of
// PaddedWidth(width_a) doubles.
HOLBA_SIMD_DECLARE(void AddSumBlock(const double* sum, int width_a, int width_b, bool first,
                                    double* block))

// y += T (T^T x) for the features of a chunk from stored T; x, y padded vectors.
HOLBA_SIMD_DECLARE(void MultiplyStored(const ChunkFeatures& chunk, const Sums& sums,
                                       const float* stored, const double* x, double* y))

}  // namespace holba::native
