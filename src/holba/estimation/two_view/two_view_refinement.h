// SPDX-License-Identifier: BSD-3-Clause
// Two-view models that fit all matches best: the greatest gain (two_view_kernels.h) near a start,
// by Levenberg-Marquardt on the errors in pixels.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "holba/estimation/two_view/matched_rays.h"

namespace holba {

enum class TwoViewKind { kEssential, kFundamental, kHomography };
// Matches that determine one.
int MinimalSize(TwoViewKind kind);

// A model of matches: gain and squared errors in px^2 (infinite ones are huge).
double GainOf(TwoViewKind kind, const Eigen::Matrix3d& model, const MatchedRays& matches,
              double max_error_px, double to_beat = -1.0);
// `squared_px` gets matches.size() values.
void ErrorsOf(TwoViewKind kind, const Eigen::Matrix3d& model, const MatchedRays& matches,
              std::vector<double>* squared_px);

struct RefinedModel {
  Eigen::Matrix3d model;  // of unit norm
  double gain = 0.0;      // not below that of the start
};
// Essential: U diag(1, 1, 0) V' with rotations U, V (5 dof). Fundamental: U diag(1, s, 0) V' (7
// dof). Homography: 8 dof. A start that is not of that form is taken to the nearest one first, if
// that can be.
RefinedModel RefineModel(TwoViewKind kind, const Eigen::Matrix3d& start, const MatchedRays& matches,
                         double max_error_px, int max_iterations);

}  // namespace holba
