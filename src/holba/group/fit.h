// SPDX-License-Identifier: BSD-3-Clause
// Tools for fitting surfaces to points and lines: normalisation, plane and quadric by linear least
// squares, search over axis directions, and Levenberg-Marquardt on the squared distances of points
// to their projections, for any type with ProjectPointWithJacobian.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "holba/geometry/line.h"
#include "holba/geometry/rigid3d.h"
#include "holba/geometry/symmetric_solve.h"
#include "holba/geometry/types.h"

namespace holba {

// Points with centroid 0 and root mean square norm 1.
struct NormalizedPoints {
  std::vector<Eigen::Vector3d> points;
  Sim3d original_from_normalized;
};
// Empty: no points, not finite, or all equal.
std::optional<NormalizedPoints> NormalizePoints(std::span<const Eigen::Vector3d> points);

// Not more than max_num of the points, evenly spread over the list.
std::vector<Eigen::Vector3d> EverySoMany(std::span<const Eigen::Vector3d> points, size_t max_num);

// Orthonormal right-handed columns, by ascending variance.
struct PrincipalAxes {
  Eigen::Vector3d centroid;
  Eigen::Vector3d variances;
  Eigen::Matrix3d axes;
};
PrincipalAxes PrincipalAxesOf(std::span<const Eigen::Vector3d> points);

// Point with the least sum of squared distances to points and lines; parallel lines alone leave it
// free along them, there it is near their feet.
Eigen::Vector3d CentreOf(std::span<const Eigen::Vector3d> points,
                         std::span<const PlueckerLine> lines);

// Plane [n w] by least squares: squared distances of the points and, for each line, of two points
// about as far apart as all features are. Empty: the features do not span a plane (to an aspect of
// 1e-6).
std::optional<Eigen::Vector4d> FitPlane(std::span<const Eigen::Vector3d> points,
                                        std::span<const PlueckerLine> lines);

// x'Ax + 2b'x + c = 0.
struct Quadric {
  Eigen::Matrix3d A;
  Eigen::Vector3d b;
  double c;
};
// Least algebraic error with unit coefficient vector, of at least 9 normalised points.
std::optional<Quadric> FitQuadric(std::span<const Eigen::Vector3d> points);

// Directions (up to sign) of low cost: the best of a grid on the hemisphere and of `candidates`,
// apart from each other, each moved downhill by a pattern search. Ascending cost, at most max_num.
std::vector<Eigen::Vector3d> BestDirections(
    const std::function<double(const Eigen::Vector3d&)>& cost,
    std::span<const Eigen::Vector3d> candidates, size_t max_num);

// Axis candidates of a surface of revolution: principal axes of the points and, from 9 points, of
// the quadric through them.
std::vector<Eigen::Vector3d> AxisCandidates(std::span<const Eigen::Vector3d> points);

// Levenberg-Marquardt. accumulate(x, &H, &b) sets H = J'J and b = J'r in the tangent space and
// returns the sum of squares (empty: undefined there, the step is refused). Returns the final sum
// of squares; empty: undefined at the start.
template <typename Manifold, typename Accumulate>
std::optional<double> MinimizeSquares(const Accumulate& accumulate, int max_iterations, double* x) {
  constexpr int kTangent = Manifold::kTangent;
  using Square = Eigen::Matrix<double, kTangent, kTangent>;
  using Tangent = Eigen::Matrix<double, kTangent, 1>;
  // Below this the residuals of normalised features are rounding.
  constexpr double kZeroCost = 1e-30;
  Square H, trial_H;
  Tangent b, trial_b;
  std::optional<double> cost = accumulate(x, &H, &b);
  if (!cost) return std::nullopt;
  double damping = 1e-4;
  for (int iteration = 0; iteration<max_iterations&& * cost> kZeroCost; ++iteration) {
    Square damped = H;
    const double floor = 1e-12 * H.diagonal().maxCoeff();
    damped.diagonal() += damping * H.diagonal().cwiseMax(floor);
    const Tangent step = SolveSymmetric<kTangent>(damped, -b);
    if (!step.allFinite()) return cost;
    double trial[Manifold::kAmbient];
    Manifold::Plus(x, step.data(), trial);
    const std::optional<double> trial_cost = accumulate(trial, &trial_H, &trial_b);
    if (trial_cost && *trial_cost < *cost) {
      const bool converged = *cost - *trial_cost <= 1e-12 * *cost;
      std::copy(trial, trial + Manifold::kAmbient, x);
      cost = trial_cost;
      H = trial_H;
      b = trial_b;
      if (converged) break;
      damping = std::max(0.1 * damping, 1e-12);
    } else {
      damping *= 10.0;
      if (damping > 1e8) break;
    }
  }
  return cost;
}

// Moves g so that sum |X - Proj_g(X)|^2 over the points is least near it. Returns that sum.
template <typename Group>
std::optional<double> RefineOnPoints(std::span<const Eigen::Vector3d> points, int max_iterations,
                                     double* g) {
  using Manifold = typename Group::Manifold;
  static constexpr int kAmbient = Manifold::kAmbient, kTangent = Manifold::kTangent;
  using Square = Eigen::Matrix<double, kTangent, kTangent>;
  using Tangent = Eigen::Matrix<double, kTangent, 1>;
  const auto accumulate = [points](const double* at, Square* H, Tangent* b) {
    RowMajor<kAmbient, kTangent> plus;
    Manifold::PlusJacobian(at, plus.data());
    H->setZero();
    b->setZero();
    std::optional<double> cost = 0.0;
    RowMajor<3, 3> d_point;
    RowMajor<3, kAmbient> d_group;
    for (const Eigen::Vector3d& X : points) {
      const std::optional<Eigen::Vector3d> projected =
          Group::ProjectPointWithJacobian(at, X, d_point.data(), d_group.data());
      if (!projected || !projected->allFinite()) return std::optional<double>();
      const Eigen::Vector3d residual = X - *projected;
      const Eigen::Matrix<double, 3, kTangent> J = -d_group * plus;
      H->noalias() += J.transpose() * J;
      b->noalias() += J.transpose() * residual;
      *cost += residual.squaredNorm();
    }
    return cost;
  };
  return MinimizeSquares<Manifold>(accumulate, max_iterations, g);
}

}  // namespace holba
