// SPDX-License-Identifier: BSD-3-Clause
// Inner loops over matched points (matched_rays.h): gains of two-view models, their squared errors
// and their normal equations, for epipolar matrices M (r2' M r1 = 0: essential or fundamental) and
// homographies H (r2 ~ H r1).
//
// Error of a match, in pixels:
//   M: the Sampson error e / |(de/dx1, de/dx2)|, e = r2' M r1, x the pixels of both ends.
//   H: root of half the sum of both squared transfer errors, first order in pixels at the observed
//      rays. Infinite where a transferred ray points away from the observed one.
//
// Gain of a match with squared error s: (1 - s / R^2)^2 below R, 0 above. The gain of MSAC (Torr
// and Zisserman 2000) at the threshold T is 1 - s / T^2; that of all thresholds T^2 from 0 to R^2,
// each weighed by its T^2 so that errors count alike in all of them, is this. So no threshold is
// chosen, as in MAGSAC (Barath et al. 2019); R is only the largest error that means anything.
//
// Normal equations of the gain's loss (a robust least squares problem with weights 1 - s / R^2)
// with respect to the 9 entries of the matrix, row by row.
#pragma once

#include <cstddef>

#include "holba/simd/targets.h"

namespace holba {

// Columns of a match: weight (1, or 0 where a pack is filled up), then of each end ray (3), d_ray
// (3x2 row by row) and d_pixel (2x3 row by row).
inline constexpr int kColumnsOfEnd = 15;
inline constexpr int kMatchColumns = 2 * kColumnsOfEnd + 1;
inline constexpr int kWeightColumn = 2 * kColumnsOfEnd;

struct MatchColumns {
  const double* values;  // column c begins at values + c * stride
  size_t stride;
  size_t size;  // whole packs of kMaxSimdLanes
};

struct MatrixNormalEquations {
  double H[81];  // upper triangle, row by row; symmetric
  double g[9];   // of 0.5 * loss: g = sum w J' r
  double gain;
};

// Matrices are 3x3 row by row. A gain that cannot exceed `to_beat` is not computed to its end: the
// result is then negative.
HOLBA_SIMD_DECLARE(
    double EpipolarGain(const MatchColumns& matches, const double* M, double max_error_px,
                        double to_beat);
    void EpipolarErrors(const MatchColumns& matches, const double* M, double* squared_px);
    void EpipolarNormal(const MatchColumns& matches, const double* M, double max_error_px,
                        MatrixNormalEquations* normal);
    double HomographyGain(const MatchColumns& matches, const double* H, const double* inverse,
                          double max_error_px, double to_beat);
    void HomographyErrors(const MatchColumns& matches, const double* H, const double* inverse,
                          double* squared_px);
    void HomographyNormal(const MatchColumns& matches, const double* H, const double* inverse,
                          double max_error_px, MatrixNormalEquations* normal))

}  // namespace holba
