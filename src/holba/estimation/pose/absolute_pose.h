// SPDX-License-Identifier: BSD-3-Clause
// The pose of an image from what it sees of a model, of which much may be wrong: LO-RANSAC (Chum,
// Matas, Kittler 2003). Hypotheses come from minimal solvers, are judged by the gain of all
// sightings together (gain.h), and the best ones are refined on all of them through the camera's
// own formulas, so that any camera model and field of view will do. The final pose is fitted in
// units of the noise that each kind of sighting shows.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "holba/base/options.h"
#include "holba/estimation/pose/sightings.h"
#include "holba/geometry/rigid3d.h"
#include "holba/geometry/types.h"
#include "holba/scene/reconstruction.h"

namespace holba {

// Names and defaults are COLMAP's where it has them.
struct AbsolutePoseOptions {
  double abs_pose_max_error = 12.0;
  int abs_pose_min_num_inliers = 30;
  double abs_pose_min_inlier_ratio = 0.25;
  bool abs_pose_refine_focal_length = true;
  bool abs_pose_refine_extra_params = true;
  double abs_pose_max_direction_error_deg = 3.0;
  double abs_pose_confidence = 0.99999;
  int abs_pose_min_num_trials = 100;
  int abs_pose_max_num_trials = 10000;
  double abs_pose_min_focal_length_ratio = 0.2;
  double abs_pose_max_focal_length_ratio = 5.0;

  void Describe(OptionTable* table) const;
};

struct AbsolutePose {
  Rigid3d cam_from_world;
  // Of the camera afterwards: the focal length estimated if it was unknown, intrinsics refined if
  // the options say so.
  std::vector<double> params;
  // 1: agrees with the pose, one value per sighting: in front of the camera, within four times the
  // noise of its kind and within the largest error.
  ForEachKind<std::vector<uint8_t>> inliers;
  ForEachKind<size_t> num_inliers;
  // Of a coordinate of a point (pixels), of the distance of a segment's end (ideal pixels), of a
  // direction (radians; one of two angles). 0: no inliers of that kind.
  ForEachKind<double> noise_sigma;
  // Of the pose in the tangent of PoseManifold, [rotation of the camera's frame (rad),
  // translation].
  Matrix6d covariance = Matrix6d::Zero();
  double gain = 0.0;  // as if so many sightings agreed exactly
  int num_trials = 0;
};

// Empty: no pose that abs_pose_min_num_inliers points and lines agree with, or these do not
// determine it. `focal_is_known`: false looks for the focal length, too, and takes only the lens
// parameters and the principal point of the camera. Equal arguments give equal bits.
std::optional<AbsolutePose> EstimateAbsolutePose(const AbsolutePoseOptions& options,
                                                 const Camera& camera, bool focal_is_known,
                                                 const AbsolutePoseMatches& matches, uint64_t seed);

}  // namespace holba
