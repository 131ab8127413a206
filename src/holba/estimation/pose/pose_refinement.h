// SPDX-License-Identifier: BSD-3-Clause
// The pose, and what of the intrinsics is free, at the top of the gain (gain.h): Gauss-Newton with
// damping on weighted squared errors, all kinds of sightings together, each in units of its noise.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "holba/estimation/pose/pose_evidence.h"

namespace holba {

// Focal lengths are free as one factor for all of them: their ratio is a property of the sensor
// that few sightings cannot improve. Lens parameters are free one by one.
struct FreeIntrinsics {
  bool focal_length = false;
  bool extra_params = false;
  // What is known of the factor before, as a standard deviation of its logarithm, and of each lens
  // parameter; they stay at their start where the sightings say nothing. 0: nothing is known.
  double focal_length_sigma = 0.0;
  double extra_param_sigma = 0.1;
};

struct PoseUnknowns {
  Rigid3d cam_from_world;
  std::vector<double> params;  // of the camera
};

struct PoseRefinement {
  ForEachKind<double> noise;
  Gain gain;
  FreeIntrinsics free;
  int max_iterations = 15;
};

struct RefinedPose {
  PoseUnknowns at;
  double gain = 0.0;
};

// Never worse than `start`.
RefinedPose RefinePose(const PoseEvidence& evidence, const PoseUnknowns& start,
                       const PoseRefinement& refinement);

// Of the pose in the tangent of PoseManifold, [rotation of the camera's frame (rad), translation]:
// the inverse of the sum of J' J / noise^2 over the sightings `counts`, the intrinsics that are
// free eliminated. Empty: they do not determine the pose.
std::optional<Matrix6d> PoseCovariance(const PoseEvidence& evidence, const PoseUnknowns& at,
                                       const ForEachKind<double>& noise, const FreeIntrinsics& free,
                                       const ForEachKind<std::vector<uint8_t>>& counts);

// A pose and a focal length that a few sightings, given by index, agree with as well as may be,
// without robustness: least squares from `start`, their errors in units of `noise`. False: it
// leaves where they are seen.
struct FewSightings {
  std::vector<uint32_t> points, lines;
};
bool FitFew(const PoseEvidence& evidence, const FewSightings& few, const ForEachKind<double>& noise,
            bool free_focal_length, int max_iterations, PoseUnknowns* at);

}  // namespace holba
