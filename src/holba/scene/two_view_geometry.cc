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

std::string_view NameOf(TwoViewConfig config) {
  switch (config) {
    case TwoViewConfig::kUndefined:
      return "undefined";
    case TwoViewConfig::kDegenerate:
      return "degenerate";
    case TwoViewConfig::kCalibrated:
      return "calibrated";
    case TwoViewConfig::kUncalibrated:
      return "uncalibrated";
    case TwoViewConfig::kPlanar:
      return "planar";
    case TwoViewConfig::kPanoramic:
      return "panoramic";
    case TwoViewConfig::kPlanarOrPanoramic:
      return "planar_or_panoramic";
    case TwoViewConfig::kWatermark:
      return "watermark";
    case TwoViewConfig::kMultiple:
      return "multiple";
    case TwoViewConfig::kCalibratedRig:
      return "calibrated_rig";
  }
  return "";
}

}  // namespace holba
