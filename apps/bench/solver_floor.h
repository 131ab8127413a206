// SPDX-License-Identifier: BSD-3-Clause
// How fast one iteration could be: the arithmetic that Levenberg-Marquardt by the Schur complement
// cannot do without, and the arithmetic that this machine can do.
#pragma once

#include "holba/problem/problem.h"

namespace holba {

// Floating point operations of one accepted step. For a residual of dimension d on a feature with f
// free unknowns and kept blocks with w free unknowns together:
//   linearise         150 d/2 (a reprojection error with its Jacobians);
//   eliminate         d f (f + 1) for V, 2 d f and 2 d w for the gradients, d w (w + 1) for U, d
//   f^2
//                     and 2 d f w for the factor of its kept rows, 2 f w for the right-hand side;
//                     and once for a feature on different kept blocks with W free unknowns together
//                     f W (W + 1), the update of the reduced system, of which only one triangle is
//                     counted;
//   back_substitute   2 f w and f^2;
// and n^3 / 3 for a dense Cholesky factor of the reduced system with n unknowns, or what a sparse
// one takes with the kept blocks ordered by approximate minimum degree, whichever is less.
// Trial costs, damping, solves with the factor and tests are left out, so are all of memory's
// costs.
struct IterationFlops {
  double linearise = 0.0, eliminate = 0.0, back_substitute = 0.0;
  double dense_factor = 0.0, sparse_factor = 0.0;

  double Factor() const;
  double Total() const { return linearise + eliminate + Factor() + back_substitute; }
};
IterationFlops CountIterationFlops(const Problem& problem);

// Multiplications and additions per second, in 10^9, of `num_threads` threads at once that do
// nothing but fused multiply-adds in the widest registers; the best of several short runs.
double MeasurePeakGflops(int num_threads);

}  // namespace holba
