// SPDX-License-Identifier: BSD-3-Clause
// A BAL problem in Ceres as an expert would write it by hand, for comparison: one block of 9
// numbers for each camera [rotation vector, translation, f, k1, k2], 3 for each point, analytic
// Jacobians, sizes known to the compiler, points eliminated first. No part of holba's solvers.
#pragma once

#include <Eigen/Core>

#include "holba/scene/reconstruction.h"
#include "holba/solver/solver.h"

namespace holba {

// Pixel minus `observed` of a point in a camera [w t f k1 k2]: p = R(w) X + t, (u, v) = (p.x, p.y)
// / p.z, pixel = f (1 + k1 r^2 + k2 r^4) (u, v), r^2 = u^2 + v^2. Jacobians row-major, 2 x 9 and 2
// x 3; null: not wanted. False: p.z is 0.
bool EvaluateBalResidual(const double* camera, const double* point, const Eigen::Vector2d& observed,
                         double* residual, double* d_camera, double* d_point);

// All poses, intrinsics and points free, square loss. Of the options: linear solver, dense library,
// threads, tolerances, limits, on_iteration (without terms). The result is not written back.
SolverSummary SolveBalWithPlainCeres(const SolverOptions& options, const Reconstruction& model);

}  // namespace holba
