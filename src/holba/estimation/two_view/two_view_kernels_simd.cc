// SPDX-License-Identifier: BSD-3-Clause
#include "holba/estimation/two_view/two_view_kernels.h"
#include "holba/simd/pack.h"

namespace holba::HOLBA_SIMD_TARGET {
namespace {

#define HOLBA_UNROLL _Pragma("GCC unroll 16")

// A gain is compared with its bound after so many matches.
constexpr size_t kBoundInterval = 64;
// Of squared derivatives: a match that no change of its pixels can bring onto the model.
constexpr double kTiny = 1e-300;
constexpr double kHuge = 1e300;

struct End {
  Pack r[3], d_ray[6], d_pixel[6];
};

HOLBA_SIMD_INLINE Pack Column(const MatchColumns& matches, int column, size_t i) {
  return Load(matches.values + static_cast<size_t>(column) * matches.stride + i);
}

HOLBA_SIMD_INLINE void LoadRays(const MatchColumns& m, size_t i, int first, End* end) {
  HOLBA_UNROLL for (int k = 0; k < 3; ++k) end->r[k] = Column(m, first + k, i);
}
HOLBA_SIMD_INLINE void LoadRayDerivatives(const MatchColumns& m, size_t i, int first, End* end) {
  HOLBA_UNROLL for (int k = 0; k < 6; ++k) end->d_ray[k] = Column(m, first + 3 + k, i);
}
HOLBA_SIMD_INLINE void LoadPixelDerivatives(const MatchColumns& m, size_t i, int first, End* end) {
  HOLBA_UNROLL for (int k = 0; k < 6; ++k) end->d_pixel[k] = Column(m, first + 9 + k, i);
}

struct Matrix {
  Pack m[9];
};
HOLBA_SIMD_INLINE Matrix BroadcastMatrix(const double* M) {
  Matrix matrix;
  HOLBA_UNROLL for (int k = 0; k < 9; ++k) matrix.m[k] = Broadcast(M[k]);
  return matrix;
}
HOLBA_SIMD_INLINE void Multiply(const Matrix& M, const Pack* v, Pack* out) {
  HOLBA_UNROLL for (int k = 0; k < 3; ++k) {
    out[k] = M.m[3 * k] * v[0] + M.m[3 * k + 1] * v[1] + M.m[3 * k + 2] * v[2];
  }
}
HOLBA_SIMD_INLINE void MultiplyTransposed(const Matrix& M, const Pack* v, Pack* out) {
  HOLBA_UNROLL for (int k = 0; k < 3; ++k) {
    out[k] = M.m[k] * v[0] + M.m[3 + k] * v[1] + M.m[6 + k] * v[2];
  }
}
HOLBA_SIMD_INLINE Pack Dot(const Pack* a, const Pack* b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

// e, its derivatives by the pixels of both ends, and the sum of their squares.
struct Epipolar {
  Pack e, by_x1[2], by_x2[2], squared_slope;
};
HOLBA_SIMD_INLINE Epipolar EvaluateEpipolar(const Matrix& M, const End& end1, const End& end2) {
  Pack line1[3], line2[3];  // derivatives of e by the rays
  Multiply(M, end1.r, line2);
  MultiplyTransposed(M, end2.r, line1);
  Epipolar at;
  at.e = Dot(end2.r, line2);
  HOLBA_UNROLL for (int k = 0; k < 2; ++k) {
    at.by_x1[k] =
        end1.d_ray[k] * line1[0] + end1.d_ray[2 + k] * line1[1] + end1.d_ray[4 + k] * line1[2];
    at.by_x2[k] =
        end2.d_ray[k] * line2[0] + end2.d_ray[2 + k] * line2[1] + end2.d_ray[4 + k] * line2[2];
  }
  at.squared_slope = at.by_x1[0] * at.by_x1[0] + at.by_x1[1] * at.by_x1[1] +
                     at.by_x2[0] * at.by_x2[0] + at.by_x2[1] * at.by_x2[1];
  return at;
}
HOLBA_SIMD_INLINE Pack SquaredError(const Epipolar& at) {
  return Select(at.squared_slope > kTiny, at.e * at.e / at.squared_slope, Broadcast(kHuge));
}
HOLBA_SIMD_INLINE Pack EpipolarError(const MatchColumns& matches, const Matrix& M, size_t i) {
  End end1, end2;
  LoadRays(matches, i, 0, &end1);
  LoadRayDerivatives(matches, i, 0, &end1);
  LoadRays(matches, i, kColumnsOfEnd, &end2);
  LoadRayDerivatives(matches, i, kColumnsOfEnd, &end2);
  return SquaredError(EvaluateEpipolar(M, end1, end2));
}

// The pixel error of the ray p at `end`; `scale` is p along the observed ray.
struct Transfer {
  Pack error[2], scale;
};
HOLBA_SIMD_INLINE Transfer EvaluateTransfer(const Pack* p, const End& end) {
  Transfer at;
  at.scale = Dot(end.r, p);
  const Pack inverse = 1.0 / Select(at.scale > kTiny, at.scale, Broadcast(kTiny));
  HOLBA_UNROLL for (int k = 0; k < 2; ++k) {
    at.error[k] = inverse * (end.d_pixel[3 * k] * p[0] + end.d_pixel[3 * k + 1] * p[1] +
                             end.d_pixel[3 * k + 2] * p[2]);
  }
  return at;
}
HOLBA_SIMD_INLINE Pack SquaredError(const Transfer& at) {
  // |r| may be more than 1 and H any size, so that only the sign of the scale means something.
  return Select(at.scale > kTiny, at.error[0] * at.error[0] + at.error[1] * at.error[1],
                Broadcast(kHuge));
}
HOLBA_SIMD_INLINE Pack HomographyError(const MatchColumns& matches, const Matrix& H,
                                       const Matrix& inverse, size_t i) {
  End end1, end2;
  LoadRays(matches, i, 0, &end1);
  LoadPixelDerivatives(matches, i, 0, &end1);
  LoadRays(matches, i, kColumnsOfEnd, &end2);
  LoadPixelDerivatives(matches, i, kColumnsOfEnd, &end2);
  Pack p[3], q[3];
  Multiply(H, end1.r, p);
  Multiply(inverse, end2.r, q);
  const Pack error =
      0.5 * (SquaredError(EvaluateTransfer(p, end2)) + SquaredError(EvaluateTransfer(q, end1)));
  return error;
}

template <typename Error>
HOLBA_SIMD_INLINE double Gain(const MatchColumns& matches, double max_error_px, double to_beat,
                              const Error& error) {
  const Pack inverse = Broadcast(1.0 / (max_error_px * max_error_px));
  const Pack zero = Broadcast(0.0);
  Pack gain = zero;
  for (size_t begin = 0; begin < matches.size; begin += kBoundInterval) {
    const size_t end =
        begin + kBoundInterval < matches.size ? begin + kBoundInterval : matches.size;
    for (size_t i = begin; i < end; i += kLanes) {
      const Pack left = 1.0 - error(i) * inverse;
      const Pack positive = Select(left > 0.0, left, zero);
      gain = gain + Column(matches, kWeightColumn, i) * positive * positive;
    }
    if (Sum(gain) + static_cast<double>(matches.size - end) <= to_beat) return -1.0;
  }
  return Sum(gain);
}

// Sums of products of a row of derivatives by the matrix, of the form a b' + c d'.
struct Sums {
  Pack H[45], g[9];
};
HOLBA_SIMD_INLINE void AddRow(const Pack* row, Pack weight, Pack residual, Sums* sums) {
  int k = 0;
  HOLBA_UNROLL for (int i = 0; i < 9; ++i) {
    const Pack weighted = weight * row[i];
    sums->g[i] = sums->g[i] + weighted * residual;
    HOLBA_UNROLL for (int j = i; j < 9; ++j) {
      sums->H[k] = sums->H[k] + weighted * row[j];
      ++k;
    }
  }
}
HOLBA_SIMD_INLINE void Clear(Sums* sums) {
  for (Pack& x : sums->H) x = Broadcast(0.0);
  for (Pack& x : sums->g) x = Broadcast(0.0);
}
HOLBA_SIMD_INLINE void Finish(const Sums& sums, Pack gain, MatrixNormalEquations* normal) {
  int k = 0;
  for (int i = 0; i < 9; ++i) {
    normal->g[i] = Sum(sums.g[i]);
    for (int j = i; j < 9; ++j) normal->H[9 * i + j] = normal->H[9 * j + i] = Sum(sums.H[k++]);
  }
  normal->gain = Sum(gain);
}

}  // namespace

double EpipolarGain(const MatchColumns& matches, const double* M, double max_error_px,
                    double to_beat) {
  const Matrix matrix = BroadcastMatrix(M);
  return Gain(matches, max_error_px, to_beat,
              [&](size_t i) { return EpipolarError(matches, matrix, i); });
}

void EpipolarErrors(const MatchColumns& matches, const double* M, double* squared_px) {
  const Matrix matrix = BroadcastMatrix(M);
  for (size_t i = 0; i < matches.size; i += kLanes)
    Store(EpipolarError(matches, matrix, i), squared_px + i);
}

void EpipolarNormal(const MatchColumns& matches, const double* M, double max_error_px,
                    MatrixNormalEquations* normal) {
  const Matrix matrix = BroadcastMatrix(M);
  const Pack inverse = Broadcast(1.0 / (max_error_px * max_error_px));
  const Pack zero = Broadcast(0.0);
  Sums sums;
  Clear(&sums);
  Pack gain = zero;
  for (size_t i = 0; i < matches.size; i += kLanes) {
    End end1, end2;
    LoadRays(matches, i, 0, &end1);
    LoadRayDerivatives(matches, i, 0, &end1);
    LoadRays(matches, i, kColumnsOfEnd, &end2);
    LoadRayDerivatives(matches, i, kColumnsOfEnd, &end2);
    const Epipolar at = EvaluateEpipolar(matrix, end1, end2);
    const Pack left = 1.0 - SquaredError(at) * inverse;
    const Mask counts = left > 0.0;
    if (!Any(counts)) continue;
    const Pack present = Column(matches, kWeightColumn, i);
    const Pack weight = Select(counts, left, zero) * present;
    gain = gain + weight * weight;
    // Residual r = e / s with s the root of squared_slope; dr = de / s - e (by_x . d by_x) / s^3.
    const Pack inverse_s = 1.0 / Sqrt(Select(counts, at.squared_slope, Broadcast(1.0)));
    const Pack r = at.e * inverse_s;
    const Pack factor = r * inverse_s * inverse_s;
    Pack left1[3], right[3];  // dr/dM = left1 r1' - r2 right'
    HOLBA_UNROLL for (int k = 0; k < 3; ++k) {
      left1[k] = end2.r[k] * inverse_s -
                 factor * (end2.d_ray[2 * k] * at.by_x2[0] + end2.d_ray[2 * k + 1] * at.by_x2[1]);
      right[k] = factor * (end1.d_ray[2 * k] * at.by_x1[0] + end1.d_ray[2 * k + 1] * at.by_x1[1]);
    }
    Pack row[9];
    HOLBA_UNROLL for (int k = 0; k < 9; ++k) {
      row[k] = left1[k / 3] * end1.r[k % 3] - end2.r[k / 3] * right[k % 3];
    }
    AddRow(row, weight, Select(counts, r, zero), &sums);
  }
  Finish(sums, gain, normal);
}

double HomographyGain(const MatchColumns& matches, const double* H, const double* inverse,
                      double max_error_px, double to_beat) {
  const Matrix matrix = BroadcastMatrix(H), inverse_matrix = BroadcastMatrix(inverse);
  return Gain(matches, max_error_px, to_beat,
              [&](size_t i) { return HomographyError(matches, matrix, inverse_matrix, i); });
}

void HomographyErrors(const MatchColumns& matches, const double* H, const double* inverse,
                      double* squared_px) {
  const Matrix matrix = BroadcastMatrix(H), inverse_matrix = BroadcastMatrix(inverse);
  for (size_t i = 0; i < matches.size; i += kLanes)
    Store(HomographyError(matches, matrix, inverse_matrix, i), squared_px + i);
}

void HomographyNormal(const MatchColumns& matches, const double* H, const double* inverse,
                      double max_error_px, MatrixNormalEquations* normal) {
  const Matrix matrix = BroadcastMatrix(H), inverse_matrix = BroadcastMatrix(inverse);
  const Pack inverse_max = Broadcast(1.0 / (max_error_px * max_error_px));
  const Pack zero = Broadcast(0.0), one = Broadcast(1.0);
  Sums sums;
  Clear(&sums);
  Pack gain = zero;
  for (size_t i = 0; i < matches.size; i += kLanes) {
    End end1, end2;
    LoadRays(matches, i, 0, &end1);
    LoadPixelDerivatives(matches, i, 0, &end1);
    LoadRays(matches, i, kColumnsOfEnd, &end2);
    LoadPixelDerivatives(matches, i, kColumnsOfEnd, &end2);
    Pack p[3], q[3];
    Multiply(matrix, end1.r, p);
    Multiply(inverse_matrix, end2.r, q);
    const Transfer forward = EvaluateTransfer(p, end2), backward = EvaluateTransfer(q, end1);
    const Pack error = 0.5 * (SquaredError(forward) + SquaredError(backward));
    const Pack left = 1.0 - error * inverse_max;
    const Mask counts = left > 0.0;
    if (!Any(counts)) continue;
    const Pack weight = Select(counts, left, zero) * Column(matches, kWeightColumn, i);
    gain = gain + weight * weight;
    // The error is half the sum of four squares.
    const Pack half_weight = 0.5 * weight;
    const Pack inverse_forward = one / Select(counts, forward.scale, one);
    const Pack inverse_backward = one / Select(counts, backward.scale, one);
    HOLBA_UNROLL for (int k = 0; k < 2; ++k) {
      Pack row[9];
      HOLBA_UNROLL for (int a = 0; a < 3; ++a) {
        const Pack by_p =
            inverse_forward * (end2.d_pixel[3 * k + a] - forward.error[k] * end2.r[a]);
        HOLBA_UNROLL for (int b = 0; b < 3; ++b) row[3 * a + b] = by_p * end1.r[b];
      }
      AddRow(row, half_weight, Select(counts, forward.error[k], zero), &sums);
    }
    // d(H^-1) = -H^-1 dH H^-1.
    HOLBA_UNROLL for (int k = 0; k < 2; ++k) {
      Pack by_q[3], by_p[3], row[9];
      HOLBA_UNROLL for (int a = 0; a < 3; ++a) {
        by_q[a] = -inverse_backward * (end1.d_pixel[3 * k + a] - backward.error[k] * end1.r[a]);
      }
      MultiplyTransposed(inverse_matrix, by_q, by_p);
      HOLBA_UNROLL for (int a = 0; a < 9; ++a) row[a] = by_p[a / 3] * q[a % 3];
      AddRow(row, half_weight, Select(counts, backward.error[k], zero), &sums);
    }
  }
  Finish(sums, gain, normal);
}

}  // namespace holba::HOLBA_SIMD_TARGET
