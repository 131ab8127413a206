// SPDX-License-Identifier: BSD-3-Clause
// Poses from minimal samples of sightings, with known intrinsics and with an unknown focal length.
#pragma once

#include <Eigen/Geometry>
#include <span>
#include <utility>
#include <vector>

#include "holba/estimation/pose/pose_refinement.h"

namespace holba {

// Mean focal length over the longer side of the image.
double FocalLengthRatio(const Camera& camera, std::span<const double> params);

struct FocalLengthRange {
  double min_ratio, max_ratio;  // of FocalLengthRatio
};

// Appends the poses that three points or lines have for these intrinsics. `turn`: as in
// linear_pose.h.
void SolveThree(const PoseEvidence& evidence, std::span<const double> params,
                const FewSightings& three, const Eigen::Quaterniond& turn,
                std::vector<Rigid3d>* poses);

// Appends poses with focal lengths from four points or lines, 8 equations for 7 unknowns. Three of
// them give poses for each of a ladder of focal lengths; where the fourth is best met along it,
// least squares of all four find the pose and the focal length. So the camera may have any model.
void SolveWithFocalLength(const PoseEvidence& evidence, const FewSightings& four,
                          const FocalLengthRange& range, const Eigen::Quaterniond& turn,
                          std::vector<PoseUnknowns>* hypotheses);

// Appends the pose of this rotation that the sightings have for these intrinsics.
void SolveWithRotation(const PoseEvidence& evidence, std::span<const double> params,
                       const Eigen::Quaterniond& rotation, const FewSightings& few,
                       std::vector<PoseUnknowns>* hypotheses);

// Appends poses with focal lengths from two directions: they make the angle in the camera that they
// make in the world for up to a few focal lengths. Directions at right angles of which one is
// parallel to the image plane make it for all, and give nothing.
void SolveDirectionsWithFocalLength(const PoseEvidence& evidence,
                                    const std::pair<uint32_t, uint32_t>& directions,
                                    const FewSightings& few, const FocalLengthRange& range,
                                    std::vector<PoseUnknowns>* hypotheses);

}  // namespace holba
