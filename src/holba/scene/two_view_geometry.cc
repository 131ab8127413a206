// SPDX-License-Identifier: BSD-3-Clause
#include "holba/scene/two_view_geometry.h"

#include <Eigen/LU>
#include <utility>

namespace holba {

PointMatches Swapped(PointMatches matches) {
  for (auto& match : matches) std::swap(match[0], match[1]);
  return matches;
}

TwoViewGeometry TwoViewGeometry::Swapped() const {
  TwoViewGeometry swapped;
  swapped.config = config;
  if (F) swapped.F = F->transpose();
  if (E) swapped.E = E->transpose();
  if (H) {
    const Eigen::FullPivLU<Eigen::Matrix3d> lu(*H);
    if (lu.isInvertible()) swapped.H = lu.inverse();
  }
  if (cam2_from_cam1) swapped.cam2_from_cam1 = cam2_from_cam1->Inverse();
  swapped.inlier_matches = holba::Swapped(inlier_matches);
  return swapped;
}

}  // namespace holba
