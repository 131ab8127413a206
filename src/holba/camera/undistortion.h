// SPDX-License-Identifier: BSD-3-Clause
// Inverse of a lens without a closed form: Newton's method with the lens's own 2 x 2 Jacobian,
// steps halved until the error decreases. If the distorted point itself is no good start, the
// solution is followed from the centre outwards. Solutions beyond the fold of the lens (where its
// Jacobian turns over) are refused: there the lens maps two rays to one point and only the inner
// one is seen.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <optional>

#include "holba/camera/distortion.h"

namespace holba {

template <typename Lens>
std::optional<Eigen::Vector2d> NewtonUndistort(const double* k, const Eigen::Vector2d& target,
                                               const Eigen::Vector2d& start) {
  constexpr int kMaxIterations = 50, kMaxHalvings = 12;
  const double tolerance = 1e-13 * (1.0 + target.norm());
  Eigen::Vector2d x = start;
  Distorted<Lens::kNumParams> at;
  if (!Lens::DistortWithJacobian(k, x.x(), x.y(), &at)) return std::nullopt;
  Eigen::Vector2d error(at.u - target.x(), at.v - target.y());
  for (int iteration = 0; iteration < kMaxIterations; ++iteration) {
    const double det = at.d_uv[0] * at.d_uv[3] - at.d_uv[1] * at.d_uv[2];
    if (!(det > 0.0) || !std::isfinite(det) || !(at.d_uv[0] + at.d_uv[3] > 0.0))
      return std::nullopt;
    Eigen::Vector2d step((at.d_uv[3] * error.x() - at.d_uv[1] * error.y()) / det,
                         (at.d_uv[0] * error.y() - at.d_uv[2] * error.x()) / det);
    if (error.norm() <= tolerance) return Eigen::Vector2d(x - step);
    // Long steps would leap over the fold.
    const double longest = std::max(0.5 * x.norm(), 0.1);
    if (step.norm() > longest) step *= longest / step.norm();
    bool decreased = false;
    for (int halving = 0; halving < kMaxHalvings && !decreased; ++halving, step *= 0.5) {
      const Eigen::Vector2d trial = x - step;
      Distorted<Lens::kNumParams> trial_at;
      if (!Lens::DistortWithJacobian(k, trial.x(), trial.y(), &trial_at)) continue;
      const Eigen::Vector2d trial_error(trial_at.u - target.x(), trial_at.v - target.y());
      if (!(trial_error.norm() < error.norm())) continue;
      x = trial;
      at = trial_at;
      error = trial_error;
      decreased = true;
    }
    // At the limit of rounding the error stops decreasing a little above the tolerance.
    if (!decreased) {
      if (error.norm() <= 100.0 * tolerance) return x;
      return std::nullopt;
    }
  }
  return std::nullopt;
}

template <typename Lens>
std::optional<Eigen::Vector2d> Undistort(const double* k, const Eigen::Vector2d& distorted) {
  if (!std::isfinite(distorted.x()) || !std::isfinite(distorted.y())) return std::nullopt;
  if constexpr (Lens::kNumParams == 0) {
    return distorted;
  } else if constexpr (requires { Lens::Undistort(k, distorted); }) {
    return Lens::Undistort(k, distorted);
  } else {
    if (const auto direct = NewtonUndistort<Lens>(k, distorted, distorted)) return direct;
    constexpr int kStages = 16;
    std::optional<Eigen::Vector2d> x = Eigen::Vector2d(0.0, 0.0);
    for (int stage = 1; stage <= kStages && x; ++stage) {
      x = NewtonUndistort<Lens>(k, distorted * (static_cast<double>(stage) / kStages), *x);
    }
    return x;
  }
}

}  // namespace holba
