// SPDX-License-Identifier: BSD-3-Clause
// The cameras as points alone estimate them, with their covariances: lines and structure are
// compared with this.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <utility>
#include <vector>

#include "holba/bundle/bundle_problem.h"
#include "holba/solver/solver.h"

namespace holba {

class CameraReference {
 public:
  // `points`: a problem of points alone, solved, its gauge fixed. Empty: it does not determine the
  // cameras, or none of them moves.
  static std::optional<CameraReference> Of(const BundleProblem& points, int num_threads,
                                           SolverWorkspace* workspace = nullptr);

  // How far the poses of another problem of the same selection are from these, in standard
  // deviations of these: the root mean square over all coordinates that move, correlations within a
  // pose included.
  double ShiftSigmas(const BundleProblem& other) const;

 private:
  struct Pose {
    size_t index;  // in BundleProblem::poses
    std::vector<double> values;
    std::vector<int> free;        // tangent coordinates that move
    Eigen::MatrixXd information;  // of those
  };
  std::vector<Pose> poses_;
};

}  // namespace holba
